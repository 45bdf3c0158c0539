// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "src/core/luma.hpp"

/// The formats whose luma is read in place: grey, planar and semi-planar YUV; and the packed 4:2:2
/// formats, which most USB cameras send, whose luma is gathered first.
#define EVENT_SIMULATOR_INPUT_FORMATS                                                          \
  "{ GRAY8, I420, YV12, NV12, NV21, Y42B, NV16, NV61, Y444, NV24, Y41B, YUV9, YVU9, A420, "    \
  "YUY2, UYVY, YVYU, VYUY, GRAY16_LE, I420_10LE, I422_10LE, Y444_10LE, A420_10LE, A422_10LE, " \
  "A444_10LE, P010_10LE, I420_12LE, I422_12LE, Y444_12LE, P012_LE, P016_LE, Y444_16LE }"

/// The luma of a video of EVENT_SIMULATOR_INPUT_FORMATS.
eventcamera::LumaFormat luma_format_of(const GstVideoInfo& info);

/// Whether the luma is interleaved with chroma, and has to be gathered.
bool has_packed_luma(const GstVideoInfo& info);

/// The output that a simulator can make of this video: the same size and framerate as events, which
/// come first, or as accumulated-event video.
GstCaps* event_simulator_output_caps(const GstCaps* video);

/// The video that a simulator needs for this output, events or accumulated-event video.
GstCaps* event_simulator_input_caps(const GstCaps* output);

/// Chooses the output where downstream leaves the choice among these caps (not empty): events, if
/// they are among them. Takes the caps.
GstCaps* event_simulator_fixate_output(GstCaps* caps);

/// Whether output caps are accumulated-event video, and not events.
bool event_simulator_draws(const GstCaps* output);
