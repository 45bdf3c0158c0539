// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <vector>

#include "gst/base/event_buffer.hpp"
#include "gst/simulator/companion_pad.hpp"

/// Caps of class images.
#define CLASS_IMAGE_CAPS                                            \
  "video/x-raw, format = (string) { GRAY8, GRAY16_LE }, " SIZE_CAPS \
  ", framerate = (fraction) [ 0, max ]"

/// Gives each event of a labelled buffer, which has a PTS of `segment`, the class of its pixel in
/// the image in force at its time: the last of `images` that is not later. Throws
/// VideoSimulatorError if an image does not fit the video.
void set_classes(GstBuffer* events, const GstSegment& segment, const GstVideoInfo& video,
                 const std::vector<CompanionPad::Item>& images);
