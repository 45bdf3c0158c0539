// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "gst/drawing/drawn_video.hpp"

/// Formats supported by FrameLuma. First those that it reads in place (grey, planar and semi-planar
/// YUV), then packed YUV, big-endian words, and RGB.
#define EVENT_SIMULATOR_INPUT_FORMATS                                                            \
  "{ GRAY8, I420, YV12, NV12, NV21, Y42B, NV16, NV61, Y444, NV24, Y41B, YUV9, YVU9, A420, "      \
  "YUY2, UYVY, YVYU, VYUY, GRAY16_LE, I420_10LE, I422_10LE, Y444_10LE, A420_10LE, A422_10LE, "   \
  "A444_10LE, P010_10LE, I420_12LE, I422_12LE, Y444_12LE, P012_LE, P016_LE, Y444_16LE, AYUV, "   \
  "VUYA, v308, GRAY16_BE, P010_10BE, RGBx, BGRx, xRGB, xBGR, RGBA, BGRA, ARGB, ABGR, RGB, BGR, " \
  "GBR, GBRA, RGBP, BGRP, RGB16, BGR16, RGB15, BGR15, GBR_10LE, GBRA_10LE, GBR_12LE, "           \
  "GBRA_12LE, ARGB64, ARGB64_LE, RGBA64_LE, BGRA64_LE, ABGR64_LE }"

/// Input video of a simulator, and the video that it draws events in.
struct SimulatorVideo {
  const char* memory;                    ///< caps feature
  const char* formats;                   ///< of the input
  const char* drawn_formats;             ///< nullptr if it cannot draw
  const char* texture_target = nullptr;  ///< of OpenGL; such simulators also accept system memory

  /// Output caps for this input: events (preferred) or event frames (accumulated-event video) of
  /// the same size and framerate.
  GstCaps* output_caps(const GstCaps* input) const;

  /// Input caps for this output, events or accumulated-event video.
  GstCaps* input_caps(const GstCaps* output) const;

  void install_pads(GstElementClass* klass) const;

 private:
  GstCaps* video_of(const GstCaps* caps, const char* of_formats) const;
};

inline constexpr SimulatorVideo system_memory_video = {
    .memory = GST_CAPS_FEATURE_MEMORY_SYSTEM_MEMORY,
    .formats = EVENT_SIMULATOR_INPUT_FORMATS,
    .drawn_formats = DRAWN_VIDEO_FORMATS,
};

/// True if output caps are accumulated-event video, false for events.
bool event_simulator_draws(const GstCaps* output);
