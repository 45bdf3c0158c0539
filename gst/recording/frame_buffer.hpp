// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "gst/base/event_buffer.hpp"
#include "src/formats/decoder.hpp"

/// Caps of the video frames of recordings.
#define RECORDED_VIDEO_CAPS                                                    \
  "video/x-raw, format = (string) { GRAY8, GRAY16_LE, BGR, BGRA }, " SIZE_CAPS \
  ", framerate = (fraction) [ 0, max ]"

/// Fills in the video info for frames like this one. False if they are too large.
bool frame_video_info(const eventcamera::Frame& frame, GstVideoInfo* info);

/// Returns a new buffer with the pixels of a frame, without timestamps. Throws std::bad_alloc.
///
/// The other metadata of the frame are in a GstCustomMeta named GstEventCameraFrame: begin,
/// end, exposure-begin and exposure-end (gint64, microseconds after the PTS), and the position of
/// its upper left corner on the sensor, x and y (gint).
GstBuffer* frame_buffer(const eventcamera::Frame& frame, const GstVideoInfo* info);

/// View of a mapped video frame of RECORDED_VIDEO_CAPS as a recording's frame at `t`, with the
/// metadata of its GstEventCameraFrame, if any.
eventcamera::Frame recorded_frame(const GstVideoFrame* video, eventcamera::Microseconds t);
