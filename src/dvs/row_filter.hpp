// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "src/dvs/light_response.hpp"
#include "src/dvs/pixel_array.hpp"
#include "src/dvs/pixel_model.hpp"
#include "src/dvs/sub_intervals.hpp"

namespace eventcamera {

/// Maximum vector length in floats; rows of luma values are padded by this.
inline constexpr int max_lanes = 16;

/// Pixels of a row in which an event may fire or a refractory period end.
class Candidates {
 public:
  /// Values of each candidate, at the start of the sub-interval unless noted.
  enum Column : std::size_t {
    target,  ///< at the end of the sub-interval
    signal,  ///< with bandwidth only, otherwise the target
    last_target,
    last_signal,  ///< with bandwidth only
    reference,
    positive,
    negative,
    leak,
    refractory_left,
    columns
  };

  std::size_t count = 0;
  std::vector<std::int32_t> x;
  std::vector<std::int32_t> shade;

  float* column(Column column) { return memory_.data() + column * x.size(); }
  const float* column(Column column) const { return memory_.data() + column * x.size(); }

  /// Removes candidate i; the last one takes its place.
  void remove(std::size_t i) {
    --count;
    x[i] = x[count];
    shade[i] = shade[count];
    for (std::size_t first = 0; first < memory_.size(); first += x.size())
      memory_[first + i] = memory_[first + count];
  }

  /// Makes space for a row, padded for vectors.
  void resize(int width) {
    const auto size = static_cast<std::size_t>(width) + max_lanes;
    x.resize(size);
    shade.resize(size);
    memory_.resize(columns * size);
  }

 private:
  std::vector<float> memory_;
};

/// Luma of a run of pixels: std::uint8_t if it has 8 bits, std::uint16_t otherwise.
struct RunLuma {
  const void* target;  ///< luma at the end of the step
  const void* shade;   ///< luma that determines bandwidth and noise
};

/// Advances a run of pixels through a sub-interval: targets, and with bandwidth signals, of all
/// pixels; references and noise budgets of those that cannot fire, usually most of them. The others
/// become `candidates`. The decision has a margin for float rounding, and is the same on every
/// processor. A run that does not end with the row must be a multiple of max_lanes pixels wide.
void filter_run(const PixelModel& model, const LightResponse& response,
                const SubInterval& sub_interval, const RunLuma& luma, const PixelRow& pixels,
                const Run& run, Candidates& candidates);

}  // namespace eventcamera
