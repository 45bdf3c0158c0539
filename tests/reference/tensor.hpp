// SPDX-License-Identifier: LGPL-2.1-or-later
// Tensors of events, as plainly as they can be written.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/tensor/tensor_settings.hpp"

namespace eventcamera::reference {

/// Values of a tensor by channel, row and column.
class Tensor {
 public:
  explicit Tensor(const TensorShape& shape) : shape_(shape), values(shape.elements()) {}
  float& at(int channel, int y, int x) {
    return values[(static_cast<std::size_t>(channel) * static_cast<std::size_t>(shape_.height) +
                   static_cast<std::size_t>(y)) *
                      static_cast<std::size_t>(shape_.width) +
                  static_cast<std::size_t>(x)];
  }

 private:
  TensorShape shape_;

 public:
  std::vector<float> values;
};

/// Each event adds its polarity to the bins nearest to (bins - 1) (t - first) / (last - first).
inline void add_voxels(std::span<const AbsoluteEvent> events, int bins, Tensor& grid) {
  for (const auto& event : events) {
    const Microseconds span = std::max<Microseconds>(events.back().t - events.front().t, 1);
    const Microseconds position = (bins - 1) * (event.t - events.front().t);
    const auto bin = static_cast<int>(position / span);
    const float share = static_cast<float>(position % span) / static_cast<float>(span);
    const float polarity = event.polarity() == Polarity::on ? 1.0F : -1.0F;
    grid.at(bin, event.y(), event.x) += polarity * (1 - share);
    if (bin + 1 < bins) grid.at(bin + 1, event.y(), event.x) += polarity * share;
  }
}

/// `events` are all since the first window.
inline Tensor tensor(std::span<const AbsoluteEvent> window, std::span<const AbsoluteEvent> events,
                     Microseconds end, const TensorShape& shape, const TensorSettings& settings) {
  Tensor result(shape);
  switch (settings.representation) {
    case Representation::voxel_grid:
      add_voxels(window, settings.bins, result);
      break;
    case Representation::histogram:
      for (const auto& event : window)
        result.at(static_cast<int>(event.polarity()), event.y(), event.x) += 1;
      break;
    case Representation::event_frame:
      for (const auto& event : window)
        result.at(0, event.y(), event.x) += event.polarity() == Polarity::on ? 1.0F : -1.0F;
      break;
    case Representation::time_surface:
      for (const auto& event : events) {
        const double age = static_cast<double>(end - event.t);
        const auto constant = static_cast<double>(settings.time_constant);
        result.at(static_cast<int>(event.polarity()), event.y(), event.x) = static_cast<float>(
            settings.decay == Decay::exponential ? std::exp(-(age / constant))
                                                 : std::max(0.0, 1 - age / constant));
      }
  }
  return result;
}

inline void normalize(std::vector<float>& values, Normalization normalization) {
  if (normalization == Normalization::mean_std) {
    double count = 0;
    double sum = 0;
    double squares = 0;
    for (const double value : values)
      if (value != 0) {
        ++count;
        sum += value;
        squares += value * value;
      }
    if (count == 0) return;
    const double mean = sum / count;
    const auto deviation =
        static_cast<float>(std::sqrt(std::max(0.0, squares / count - mean * mean)));
    for (auto& value : values)
      if (value != 0) value = (value - static_cast<float>(mean)) / (deviation > 0 ? deviation : 1);
  } else if (normalization == Normalization::max) {
    float max = 0;
    for (const float value : values) max = std::max(max, std::abs(value));
    for (auto& value : values) value = max > 0 ? value / max : value;
  }
}

/// The value of a half-precision number: sign, 5 bits of exponent, 10 of mantissa.
inline double value_of_half(int bits) {
  const int exponent = bits >> 10 & 31;
  const int mantissa = bits & 1023;
  const double magnitude = exponent == 31  ? std::numeric_limits<double>::infinity()
                           : exponent == 0 ? std::ldexp(mantissa, -24)
                                           : std::ldexp(1024 + mantissa, exponent - 25);
  return (bits & 0x8000) != 0 ? -magnitude : magnitude;
}

/// The value of the half-precision number that is nearest to a value; of two, the even one.
inline double nearest_half(double value) {
  constexpr int min_exponent = -14;
  constexpr int mantissa_bits = 10;
  int exponent = 0;
  std::frexp(value, &exponent);  // of a mantissa between 0.5 and 1
  const double step = std::ldexp(1, std::max(exponent - 1, min_exponent) - mantissa_bits);
  const double rounded = std::nearbyint(value / step) * step;
  return std::abs(rounded) > 65504 ? std::copysign(std::numeric_limits<double>::infinity(), value)
                                   : rounded;
}

/// zero + steps * value, rounded to nearest and clamped.
inline std::uint8_t byte_of(float value, float steps, float zero) {
  return static_cast<std::uint8_t>(std::clamp(std::nearbyint(value * steps + zero), 0.0F, 255.0F));
}

}  // namespace eventcamera::reference
