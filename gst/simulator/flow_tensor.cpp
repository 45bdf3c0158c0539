// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/flow_tensor.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "gst/simulator/video_simulator.hpp"
#include "src/core/max_side.hpp"

using eventcamera::Flow;
using eventcamera::Image;

/// True if these are the dimensions of a flow; further ones are 1.
static bool are_dimensions(std::string_view dimensions, const std::string& of_flow) {
  if (!dimensions.starts_with(of_flow)) return false;
  dimensions.remove_prefix(of_flow.size());
  while (dimensions.starts_with(":1")) dimensions.remove_prefix(2);
  return dimensions.empty();
}

static float limited(float flow) {
  constexpr float longest = eventcamera::max_side;
  return std::isfinite(flow) ? std::clamp(flow, -longest, longest) : 0;
}

void copy_flow(const CompanionPad::Item& tensor, Image<Flow>& flow) {
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
