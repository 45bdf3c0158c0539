// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "src/formats/aedat/aedat4.hpp"

/// What AEDAT4's frames are in GStreamer.
#define AEDAT_VIDEO_CAPS                                                                         \
  "video/x-raw, format = (string) { GRAY8, GRAY16_LE, BGR, BGRA }, width = (int) [ 1, 32767 ], " \
  "height = (int) [ 1, 32767 ], framerate = (fraction) [ 0, max ]"

/// The video of frames like this one. False where there is none so large.
bool aedat_frame_info(const eventcamera::Aedat4Frame& frame, GstVideoInfo* info);

/// A buffer of the frame's pixels, without a time. Throws std::bad_alloc.
GstBuffer* aedat_frame_buffer(const eventcamera::Aedat4Frame& frame, const GstVideoInfo* info);

/// A mapped frame of video as AEDAT4 has it, without a time. Its format is one of those above.
eventcamera::Aedat4Frame aedat_frame_of(const GstVideoFrame* video);
