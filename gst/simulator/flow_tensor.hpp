// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "gst/base/errors.hpp"
#include "gst/simulator/companion_pad.hpp"
#include "src/core/image.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/simulate/simulator.hpp"

/// Caps of dense optical flow: a tensor of NNStreamer with the dimensions 2:width:height:1, that is
/// x and y of each pixel, in pixels, row by row.
#define FLOW_TENSOR_CAPS \
  "other/tensors, format = (string) static, num_tensors = (int) 1, types = (string) float32"

/// Pad that takes optical flow.
class FlowTensors : public CompanionPad {
 public:
  explicit FlowTensors(GstDebugCategory* category)
      : CompanionPad("flow tensors", category), warn_of_no_flow_(category) {}

  /// Gives the simulator of `element` the flow of an interval of `segment`, if it needs one and a
  /// source is linked; flow that is not finite counts as 0. False if the stream is flushing. Throws
  /// VideoSimulatorError unless a tensor has the size of the video.
  bool give(GstElement* element, eventcamera::IntervalSimulator& simulator,
            const GstSegment& segment, const GstVideoInfo& video, Nanoseconds start,
            Nanoseconds end);

  /// Drops the memory of the flow.
  void reset();

 private:
  WarnOnce warn_of_no_flow_;
  eventcamera::Image<eventcamera::Flow> flow_{};  ///< that was given, if any
};
