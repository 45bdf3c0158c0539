// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "src/core/luma.hpp"

/// The formats whose brightness is read where it lies: grey, planar and semi-planar YUV. The packed
/// 4:2:2 formats stand with them because most USB cameras send nothing else; their luma is
/// gathered.
#define EVENT_SIMULATOR_INPUT_FORMATS                                                          \
  "{ GRAY8, I420, YV12, NV12, NV21, Y42B, NV16, NV61, Y444, NV24, Y41B, YUV9, YVU9, A420, "    \
  "YUY2, UYVY, YVYU, VYUY, GRAY16_LE, I420_10LE, I422_10LE, Y444_10LE, A420_10LE, A422_10LE, " \
  "A444_10LE, P010_10LE, I420_12LE, I422_12LE, Y444_12LE, P012_LE, P016_LE, Y444_16LE }"

/// How a simulator sees a video of EVENT_SIMULATOR_INPUT_FORMATS.
eventcamera::LumaFormat luma_format_of(const GstVideoInfo& info);

/// Whether the luma lies between chroma, and is to be gathered.
bool has_packed_luma(const GstVideoInfo& info);
