// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/moving_points.hpp"

#include <algorithm>

#define HWY_TARGET_INCLUDE "src/simulate/moving_points.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Positions = hn::CappedTag<std::int32_t, MovingPoints::block_size>;
using Position = hn::Vec<Positions>;

/// moved() in 32 bits, enough for positions within a frame.
Position move(Position start, Position motion, Position step) {
  const auto half = hn::Set(Positions(), 1 << 15);
  return hn::ShiftRight<16>(hn::ShiftLeft<16>(start) + half + motion * step);
}

/// Writes the index of each lane of the blocks.
void indices_of(std::span<const MovingPoints::Block> blocks, int j, int stride, std::int32_t* out) {
  const Positions positions;
  const std::size_t lanes = hn::Lanes(positions);
  const auto step = hn::Set(positions, j);
  const auto row = hn::Set(positions, stride);
  for (const auto& block : blocks) {
    for (std::size_t i = 0; i < MovingPoints::block_size; i += lanes) {
      const auto x =
          move(hn::Load(positions, block.x + i), hn::Load(positions, block.dx + i), step);
      const auto y =
          move(hn::Load(positions, block.y + i), hn::Load(positions, block.dy + i), step);
      hn::StoreU(y * row + x, positions, out);
      out += lanes;
    }
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(indices_of);

std::span<const std::int32_t> MovingPoints::at(int j, int stride, std::size_t chunk,
                                               std::vector<std::int32_t>& memory) const {
  const std::size_t first = chunk * chunk_size;
  const std::size_t count = std::min(chunk_size, size_ - first);
  const std::size_t blocks = (count + block_size - 1) / block_size;
  memory.resize(chunk_size);
  HWY_DYNAMIC_DISPATCH(indices_of)
  (std::span(blocks_).subspan(first / block_size, blocks), j, stride, memory.data());
  return std::span<const std::int32_t>(memory).first(count);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
