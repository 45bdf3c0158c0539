// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/image.hpp"
#include "src/core/label.hpp"

/// The state of a simulator as bytes: values without gaps, in the byte order of the machine, and
/// their checksum. A function serialize(archive) writes the values of an object to a StateWriter,
/// one after another, or reads them from a StateReader.

namespace eventcamera {

/// FNV-1a, 64 bits.
inline std::uint64_t checksum_of(std::span<const std::uint8_t> bytes) {
  std::uint64_t sum = 0xcbf29ce484222325;
  for (const auto byte : bytes) sum = (sum ^ byte) * 0x100000001b3;
  return sum;
}

template <class T>
concept StateValue = std::is_trivially_copyable_v<T>;

class StateWriter {
 public:
  static constexpr bool is_reading = false;

  template <StateValue T>
  void value(const T& value, const std::predicate<T> auto&) {
    append(&value, sizeof value);
  }

  /// A number of items that follow.
  std::size_t count(std::size_t count, std::size_t) {
    const std::uint64_t written = count;
    append(&written, sizeof written);
    return count;
  }

  template <StateValue T>
  void image(const Image<T>& image, const std::predicate<T> auto&) {
    for (int y = 0; y < image.height(); ++y)
      append(image.row(y), static_cast<std::size_t>(image.width()) * sizeof(T));
  }

  /// Ends the state.
  std::vector<std::uint8_t> finish() {
    const std::uint64_t sum = checksum_of(bytes_);
    append(&sum, sizeof sum);
    return std::move(bytes_);
  }

 private:
  void append(const void* data, std::size_t size) {
    const auto* const first = static_cast<const std::uint8_t*>(data);
    bytes_.insert(bytes_.end(), first, first + size);
  }

  std::vector<std::uint8_t> bytes_;
};

/// Throws std::runtime_error where the bytes are no state, such as for a value that is not valid.
class StateReader {
 public:
  static constexpr bool is_reading = true;

  explicit StateReader(std::span<const std::uint8_t> bytes) : rest_(bytes) {
    std::uint64_t sum = 0;
    if (bytes.size() < sizeof sum) throw std::runtime_error("it is too short");
    rest_ = bytes.first(bytes.size() - sizeof sum);
    std::memcpy(&sum, rest_.data() + rest_.size(), sizeof sum);
    if (sum != checksum_of(rest_)) throw std::runtime_error("its checksum is wrong");
  }

  template <StateValue T>
  void value(T& value, const std::predicate<T> auto& is_valid) {
    take(&value, sizeof value);
    if (!is_valid(value)) throw std::runtime_error("a value in it is out of range");
  }

  /// `item_size` bytes or more are left for each of the items.
  std::size_t count(std::size_t, std::size_t item_size) {
    std::uint64_t count = 0;
    take(&count, sizeof count);
    if (count > rest_.size() / item_size) throw std::runtime_error("it is too short");
    return static_cast<std::size_t>(count);
  }

  template <StateValue T>
  void image(Image<T>& image, const std::predicate<T> auto& is_valid) {
    for (int y = 0; y < image.height(); ++y) {
      T* const row = image.row(y);
      take(row, static_cast<std::size_t>(image.width()) * sizeof(T));
      for (int x = 0; x < image.width(); ++x)
        if (!is_valid(row[x])) throw std::runtime_error("a pixel in it is out of range");
    }
  }

  /// Nothing may be left.
  void finish() const {
    if (!rest_.empty()) throw std::runtime_error("it is too long");
  }

 private:
  void take(void* data, std::size_t size) {
    if (size > rest_.size()) throw std::runtime_error("it is too short");
    std::memcpy(data, rest_.data(), size);
    rest_ = rest_.subspan(size);
  }

  std::span<const std::uint8_t> rest_;
};

/// Limit of all times from the start of an interval on, microseconds. They are at most a few
/// seconds.
inline constexpr double max_state_time = 1e9;

/// Limit of times since the first frame, microseconds: centuries.
inline constexpr double max_state_clock = 1e16;

/// Limit of all levels and thresholds, units of the response. Those of common settings are below
/// 10.
inline constexpr double max_state_level = 1e6;

/// For values that are valid whatever they are.
inline constexpr auto is_anything = [](const auto&) { return true; };

/// For values from `low` to `high`, which NaN is not.
template <class T>
constexpr auto is_within(T low, T high) {
  return [low, high](const T& value) { return low <= value && value <= high; };
}

/// For events of these pixels, with_cause().
inline auto is_event_within(const Box& pixels) {
  return [pixels](const Event& event) {
    const Event pixel = without_cause(event);
    return pixel.x >= pixels.left && pixel.x < pixels.right && pixel.y() >= pixels.top &&
           pixel.y() < pixels.bottom && cause_of(event) <= Cause::exposure_pulse;
  };
}

}  // namespace eventcamera
