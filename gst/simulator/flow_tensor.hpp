// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/simulator/companion_pad.hpp"
#include "src/core/image.hpp"
#include "src/flow/dense_flow.hpp"

/// Caps of dense optical flow: a tensor of NNStreamer with the dimensions 2:width:height:1, that is
/// x and y of each pixel, in pixels, row by row.
#define FLOW_TENSOR_CAPS \
  "other/tensors, format = (string) static, num_tensors = (int) 1, types = (string) float32"

/// Copies a tensor; flow that is not finite counts as 0. Throws VideoSimulatorError unless it has
/// the size of `flow`.
void copy_flow(const CompanionPad::Item& tensor, eventcamera::Image<eventcamera::Flow>& flow);
