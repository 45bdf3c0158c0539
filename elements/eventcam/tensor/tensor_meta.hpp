// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "src/tensor/tensor_settings.hpp"

/// Describes the bytes of a buffer in a GstTensorMeta, with its dimensions in C order: 1, channels,
/// rows, columns. Without effect before GStreamer 1.26.
void add_tensor_meta(GstBuffer* buffer, const eventcamera::TensorShape& shape,
                     const eventcamera::TensorSettings& settings);
