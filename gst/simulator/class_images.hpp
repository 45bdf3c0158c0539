// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "gst/base/event_caps.hpp"
#include "gst/simulator/companion_pad.hpp"

/// Caps of class images.
#define CLASS_IMAGE_CAPS                                            \
  "video/x-raw, format = (string) { GRAY8, GRAY16_LE }, " SIZE_CAPS \
  ", framerate = (fraction) [ 0, max ]"

/// Pad that takes images of classes.
class ClassImages : public CompanionPad {
 public:
  explicit ClassImages(GstDebugCategory* category) : CompanionPad("class images", category) {}

  /// If a source of images is linked, gives each event of a labelled buffer, which covers an
  /// interval of `segment`, the class of its pixel in the most recent image at that time. Waits for
  /// the images until `end`. Throws VideoSimulatorError if one does not fit the video.
  GstFlowReturn set_classes(GstBuffer* events, const GstSegment& segment, const GstVideoInfo& video,
                            Nanoseconds start, Nanoseconds end);
};
