// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "src/formats/reader.hpp"

/// The video that frames of recordings are in GStreamer.
#define RECORDED_VIDEO_CAPS                                                                      \
  "video/x-raw, format = (string) { GRAY8, GRAY16_LE, BGR, BGRA }, width = (int) [ 1, 32767 ], " \
  "height = (int) [ 1, 32767 ], framerate = (fraction) [ 0, max ]"

/// The video of frames like this one. False where there is none so large.
bool frame_video_info(const eventcamera::Frame& frame, GstVideoInfo* info);

/// Makes a buffer of a frame's pixels, without a time. Throws std::bad_alloc.
GstBuffer* frame_buffer(const eventcamera::Frame& frame, const GstVideoInfo* info);

/// A mapped frame of RECORDED_VIDEO_CAPS as recordings have it, without a time.
eventcamera::Frame recorded_frame(const GstVideoFrame* video);
