// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/tensor/tensor_settings.hpp"

namespace eventcamera {

/// Tensors of successive windows of events.
///
/// A voxel grid spans the time from the first to the last event of its window, as in E2VID (Rebecq
/// et al., TPAMI 2019, section 3.2): an event at t adds its polarity, +1 or -1, to the two bins
/// nearest to (bins - 1) (t - first) / (last - first), in proportion to their closeness. Events of
/// a single instant are all in bin 0.
///
/// A time surface (Lagorce et al., TPAMI 2017) remembers the last events of earlier windows.
class EventTensor {
 public:
  /// Bytes of a tensor and its intermediate values: numbers before conversion, times of events.
  static std::size_t memory(const TensorShape& shape, const TensorSettings& settings);

  EventTensor(int width, int height, const TensorSettings& settings);

  const TensorShape& shape() const { return shape_; }
  std::size_t bytes() const { return shape_.elements() * size_of(settings_.type); }

  /// Forgets earlier windows.
  void reset();

  /// Writes the tensor of a window that ends at `end`, bytes() in size and aligned for its numbers.
  /// Events must lie inside the sensor, be sorted by time and not be later than `end`.
  void write(std::span<const AbsoluteEvent> events, Microseconds end, std::byte* out);

 private:
  void represent(std::span<const AbsoluteEvent> events, Microseconds end, std::span<float> values);

  TensorSettings settings_;
  TensorShape shape_;
  std::vector<float> values_;         ///< before conversion; empty for float32
  std::vector<Microseconds> latest_;  ///< times of a time surface's last events; else empty
};

}  // namespace eventcamera
