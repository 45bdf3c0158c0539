// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/tensor/event_tensor.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "src/tensor/tensor_elements.hpp"

namespace eventcamera {
namespace {

/// Time of a pixel's last event if it had none.
constexpr Microseconds never = std::numeric_limits<Microseconds>::min();

std::size_t pixel_of(const AbsoluteEvent& event, const TensorShape& shape) {
  return static_cast<std::size_t>(event.y()) * static_cast<std::size_t>(shape.width) + event.x;
}

/// Cell of an event in the channel of its polarity.
std::size_t cell_of(const AbsoluteEvent& event, const TensorShape& shape) {
  return (event.polarity() == Polarity::on ? shape.plane() : 0) + pixel_of(event, shape);
}

float sign_of(const AbsoluteEvent& event) {
  return event.polarity() == Polarity::on ? 1.0F : -1.0F;
}

void add_voxels(std::span<const AbsoluteEvent> events, const TensorShape& shape, float* grid) {
  if (events.empty()) return;
  const Microseconds first = events.front().t;
  const Microseconds span = std::max<Microseconds>(events.back().t - first, 1);
  const int last_bin = shape.channels - 1;
  const auto plane = static_cast<std::ptrdiff_t>(shape.plane());
  // Events are sorted, so bins follow each other; times are in units of a bin / span.
  Microseconds bin_start = 0;
  float* bin = grid;
  const float* const last = grid + last_bin * plane;
  for (const auto& event : events) {
    Microseconds past = (event.t - first) * last_bin - bin_start;
    while (past >= span) {
      past -= span;
      bin_start += span;
      bin += plane;
    }
    float* const at = bin + pixel_of(event, shape);
    const float sign = sign_of(event);
    if (bin == last) {
      *at += sign;
      continue;
    }
    const float share = static_cast<float>(past) / static_cast<float>(span);
    at[0] += sign * (1 - share);
    at[plane] += sign * share;
  }
}

void count_polarities(std::span<const AbsoluteEvent> events, const TensorShape& shape,
                      float* counts) {
  for (const auto& event : events) counts[cell_of(event, shape)] += 1;
}

void sum_polarities(std::span<const AbsoluteEvent> events, const TensorShape& shape, float* sums) {
  for (const auto& event : events) sums[pixel_of(event, shape)] += sign_of(event);
}

/// In double precision, whose rounding to float is the same on every processor.
float decayed(Microseconds age, const TensorSettings& settings) {
  const double constants = static_cast<double>(age) / static_cast<double>(settings.time_constant);
  return static_cast<float>(settings.decay == Decay::linear ? std::max(0.0, 1 - constants)
                                                            : std::exp(-constants));
}

/// Value per event, or per standard deviation or maximum after normalization, in a tensor of bytes.
ByteScale scale_of(const TensorSettings& settings) {
  const bool is_signed = settings.representation == Representation::voxel_grid ||
                         settings.representation == Representation::event_frame;
  switch (settings.normalization) {
    case Normalization::mean_std:
      return {.steps = 32, .zero = 128};
    case Normalization::max:
      return is_signed ? ByteScale{.steps = 127, .zero = 128} : ByteScale{.steps = 255, .zero = 0};
    case Normalization::none:
      break;
  }
  if (settings.representation == Representation::time_surface) return {.steps = 255, .zero = 0};
  return {.steps = 1, .zero = is_signed ? 128.0F : 0.0F};
}

}  // namespace

std::size_t EventTensor::memory(const TensorShape& shape, const TensorSettings& settings) {
  std::size_t bytes = size_of(settings.type);
  if (settings.type != ElementType::float32) bytes += sizeof(float);
  if (settings.representation == Representation::time_surface) bytes += sizeof(Microseconds);
  return shape.elements() * bytes;
}

EventTensor::EventTensor(int width, int height, const TensorSettings& settings)
    : settings_(settings), shape_(width, height, settings) {
  if (settings.type != ElementType::float32) values_.resize(shape_.elements());
  if (settings.representation == Representation::time_surface)
    latest_.resize(shape_.elements(), never);
}

void EventTensor::reset() {
  std::ranges::fill(latest_, never);
}

void EventTensor::represent(std::span<const AbsoluteEvent> events, Microseconds end,
                            std::span<float> values) {
  if (settings_.representation == Representation::time_surface) {
    for (const auto& event : events) latest_[cell_of(event, shape_)] = event.t;
    std::ranges::transform(latest_, values.begin(), [&](Microseconds time) {
      return time == never ? 0 : decayed(end - time, settings_);
    });
    return;
  }
  std::ranges::fill(values, 0.0F);
  switch (settings_.representation) {
    case Representation::voxel_grid:
      return add_voxels(events, shape_, values.data());
    case Representation::histogram:
      return count_polarities(events, shape_, values.data());
    case Representation::event_frame:
      return sum_polarities(events, shape_, values.data());
    case Representation::time_surface:
      break;
  }
}

void EventTensor::write(std::span<const AbsoluteEvent> events, Microseconds end, std::byte* out) {
  const std::span<float> values = settings_.type == ElementType::float32
                                      ? std::span(reinterpret_cast<float*>(out), shape_.elements())
                                      : std::span(values_);
  represent(events, end, values);
  normalize(values, settings_.normalization);
  if (settings_.type == ElementType::float16)
    write_float16(values, reinterpret_cast<std::uint16_t*>(out));
  else if (settings_.type == ElementType::uint8)
    write_uint8(values, scale_of(settings_), reinterpret_cast<std::uint8_t*>(out));
}

}  // namespace eventcamera
