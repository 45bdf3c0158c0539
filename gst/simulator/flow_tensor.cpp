// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/flow_tensor.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <string_view>

#include "gst/simulator/video_simulator.hpp"
#include "src/core/max_side.hpp"

using eventcamera::Flow;
using eventcamera::Image;
using eventcamera::IntervalSimulator;
using eventcamera::Nanoseconds;

/// True if these are the dimensions of a flow; further ones are 1.
static bool are_dimensions(std::string_view dimensions, const std::string& of_flow) {
  if (!dimensions.starts_with(of_flow)) return false;
  dimensions.remove_prefix(of_flow.size());
  while (dimensions.starts_with(":1")) dimensions.remove_prefix(2);
  return dimensions.empty();
}

static float limited(float flow) {
  constexpr float max_length = eventcamera::max_side;
  return std::isfinite(flow) ? std::clamp(flow, -max_length, max_length) : 0;
}

/// Copies a tensor of the size of `flow`.
static void copy_flow(const CompanionPad::Item& tensor, Image<Flow>& flow) {
  const auto expected = "2:" + std::to_string(flow.width()) + ":" + std::to_string(flow.height());
  const char* dimensions =
      gst_structure_get_string(gst_caps_get_structure(tensor.caps.get(), 0), "dimensions");
  if (dimensions == nullptr || !are_dimensions(dimensions, expected))
    throw VideoSimulatorError(
        {GST_CORE_ERROR_NEGOTIATION, "The optical flow has the dimensions " +
                                         std::string(dimensions != nullptr ? dimensions : "none") +
                                         ", and the video needs " + expected + ":1."},
        "caps of flow_sink");

  const auto row_size = static_cast<gsize>(flow.width()) * sizeof(Flow);
  const gsize size = row_size * static_cast<gsize>(flow.height());
  const gsize actual = gst_buffer_get_size(tensor.buffer.get());
  if (actual != size)
    throw VideoSimulatorError(
        {GST_RESOURCE_ERROR_FAILED, "Cannot read a tensor of optical flow: it has " +
                                        std::to_string(actual) + " bytes instead of " +
                                        std::to_string(size) + ". Check the element upstream."},
        "size of a buffer");
  for (int y = 0; y < flow.height(); ++y) {
    Flow* row = flow.row(y);
    gst_buffer_extract(tensor.buffer.get(), static_cast<gsize>(y) * row_size, row, row_size);
    std::transform(row, row + flow.width(), row, [](const Flow& pixel) {
      return Flow{limited(pixel.x), limited(pixel.y)};
    });
  }
}

/// True if a tensor is the flow of an interval: it starts with it, and ends with it if it has a
/// duration, which it would not after frames were skipped.
static bool is_flow_of(const CompanionPad::Item& tensor, Nanoseconds running_start,
                       Nanoseconds duration) {
  if (std::abs(tensor.time - running_start) >= Nanoseconds{event_resolution}) return false;
  const GstClockTime own = GST_BUFFER_DURATION(tensor.buffer.get());
  return !GST_CLOCK_TIME_IS_VALID(own) || (own < static_cast<GstClockTime>(duration) * 3 / 2 &&
                                           own > static_cast<GstClockTime>(duration) / 2);
}

bool FlowTensors::give(GstElement* element, IntervalSimulator& simulator, const GstSegment& segment,
                       const GstVideoInfo& video, Nanoseconds start, Nanoseconds end) {
  const auto time = running_time_of(segment, static_cast<GstClockTime>(start));
  if (!time || !is_linked() || !simulator.needs_flow()) return true;
  const auto found = items(*time, *time);
  if (!found) return false;
  if (found->empty() || !is_flow_of(found->back(), *time, end - start)) {
    warn_of_no_flow_(
        element,
        {GST_STREAM_ERROR_FORMAT,
         "The optical flow of a frame is missing: finding it here. Send the flow to the next frame "
         "with the timestamp and the duration of each frame."},
        "no matching buffer on flow_sink");
    return true;
  }
  const int width = GST_VIDEO_INFO_WIDTH(&video);
  const int height = GST_VIDEO_INFO_HEIGHT(&video);
  if (flow_.width() != width || flow_.height() != height) flow_ = {width, height};
  copy_flow(found->back(), flow_);
  simulator.give_flow(flow_.view());
  return true;
}

void FlowTensors::reset() {
  flow_ = {};
  warn_of_no_flow_.reset();
}
