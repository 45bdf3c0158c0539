// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

/// Formats supported by FrameLuma. First those that it reads in place (grey, planar and semi-planar
/// YUV), then packed YUV, big-endian words, and RGB.
#define EVENT_SIMULATOR_INPUT_FORMATS                                                            \
  "{ GRAY8, I420, YV12, NV12, NV21, Y42B, NV16, NV61, Y444, NV24, Y41B, YUV9, YVU9, A420, "      \
  "YUY2, UYVY, YVYU, VYUY, GRAY16_LE, I420_10LE, I422_10LE, Y444_10LE, A420_10LE, A422_10LE, "   \
  "A444_10LE, P010_10LE, I420_12LE, I422_12LE, Y444_12LE, P012_LE, P016_LE, Y444_16LE, AYUV, "   \
  "VUYA, v308, GRAY16_BE, P010_10BE, RGBx, BGRx, xRGB, xBGR, RGBA, BGRA, ARGB, ABGR, RGB, BGR, " \
  "GBR, GBRA, RGBP, BGRP, RGB16, BGR16, RGB15, BGR15, GBR_10LE, GBRA_10LE, GBR_12LE, "           \
  "GBRA_12LE, ARGB64, ARGB64_LE, RGBA64_LE, BGRA64_LE, ABGR64_LE }"

/// Output caps for this video: events (preferred) or accumulated-event video of the same size and
/// framerate.
GstCaps* event_simulator_output_caps(const GstCaps* video);

/// Input caps for this output, events or accumulated-event video.
GstCaps* event_simulator_input_caps(const GstCaps* output);

/// Fixates the output to events if `caps` (not empty) include them, else to video. Takes ownership
/// of `caps`.
GstCaps* event_simulator_fixate_output(GstCaps* caps);

/// True if output caps are accumulated-event video, false for events.
bool event_simulator_draws(const GstCaps* output);
