// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "src/core/event_buckets.hpp"
#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"
#include "src/render/palette.hpp"

namespace eventcamera {

/// Lookup tables for SIMD code: each byte of a pixel, by kind.
using KindTables = std::array<std::array<std::uint8_t, 16>, 4>;

/// Accumulates events into an image of the polarities that fired at each pixel.
class Accumulator {
 public:
  Accumulator(int width, int height) : fired_(width, height) {}

  /// Adds events, which must all lie inside the picture.
  void add(std::span<const Event> events);
  void add(const EventBuckets& events, ThreadPool& threads);

  /// Draws the accumulated events and starts over. `stride` in bytes.
  void draw(const Palette& palette, const PixelLayout& layout, std::byte* out,
            std::ptrdiff_t stride, ThreadPool& threads);

 private:
  Image<std::uint8_t> fired_;  // bit 0: OFF, bit 1: ON
};

}  // namespace eventcamera
