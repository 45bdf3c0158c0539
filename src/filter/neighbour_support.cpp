// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/neighbour_support.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/filter/neighbour_support.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

/// Sums over the cells of a square around a pixel, without the pixel itself.
template <int radius>
class Neighbours {
 public:
  static constexpr int side = 2 * radius + 1;
  using Lanes = hn::CappedTag<std::int32_t, radius == 1 ? 4 : 8>;
  using Vector = hn::Vec<Lanes>;

  explicit Neighbours(std::ptrdiff_t stride) : stride_(stride) {}

  /// Sum of value(stamps), which has to be 0 or positive.
  template <class Value>
  HWY_INLINE std::uint32_t sum(const Stamp* cell, const Value& value) const {
    const Lanes lanes;
    auto total = hn::Zero(lanes);
    for (int first = 0; first < side; first += static_cast<int>(hn::Lanes(lanes))) {
      auto column = hn::Zero(lanes);
      for (int y = 1; y <= radius; ++y)
        column =
            hn::Add(column, hn::Add(value(stamps(cell, first, -y)), value(stamps(cell, first, y))));
      const auto beside = value(stamps(cell, first, 0));
      total = hn::Add(total, hn::And(column, hn::LoadU(lanes, in_square + first)));
      total = hn::Add(total, hn::And(beside, hn::LoadU(lanes, beside_centre + first)));
    }
    return static_cast<std::uint32_t>(hn::GetLane(hn::SumOfLanes(lanes, total)));
  }

  HWY_INLINE void prefetch(const Stamp* cell) const {
    const auto* bytes = reinterpret_cast<const std::byte*>(cell);
    for (int y = -radius; y <= radius; ++y) __builtin_prefetch(bytes + y * stride_, 1);
  }

 private:
  static constexpr std::int32_t in_square[16] = {-1, -1, -1, radius > 1 ? -1 : 0,
                                                 radius > 1 ? -1 : 0};
  static constexpr std::int32_t beside_centre[16] = {-1, radius > 1 ? -1 : 0, radius > 1 ? 0 : -1,
                                                     radius > 1 ? -1 : 0, radius > 1 ? -1 : 0};
  static_assert(radius == 1 || radius == 2);

  HWY_INLINE Vector stamps(const Stamp* cell, int x, int y) const {
    const auto* row = reinterpret_cast<const std::byte*>(cell) + y * stride_;
    return hn::LoadU(Lanes(), reinterpret_cast<const std::int32_t*>(row) + (x - radius));
  }

  std::ptrdiff_t stride_;
};

/// Decides on a batch: an event is kept if the sum of value(left) is at least `needed`. `left` is
/// the remaining correlation time, negative once it has passed.
template <int radius, class Value>
HWY_INLINE void find_support(const StampedBatch<Stamp>& batch, Stamp correlation_time,
                             std::uint32_t needed, const Value& value) {
  // Few enough that prefetched lines stay in the cache.
  constexpr std::size_t distance = radius == 1 ? 16 : 4;
  const typename Neighbours<radius>::Lanes lanes;
  const Neighbours<radius> neighbours(batch.cells.stride);
  const std::size_t size = batch.events.size();
  for (std::size_t i = 0; i < std::min(distance, size); ++i)
    neighbours.prefetch(batch.cells.at(batch.events[i]));
  for (std::size_t i = 0; i < size; ++i) {
    neighbours.prefetch(batch.cells.at(batch.events[std::min(i + distance, size - 1)]));
    const Event event = batch.events[i];
    const Stamp now = batch.start + event.t;
    Stamp* const cell = batch.cells.at(event);
    // Negative for a stamp of 0, never.
    const auto minus_age = hn::Set(lanes, static_cast<std::int32_t>(correlation_time - now));
    const auto sum = neighbours.sum(
        cell, [&](auto stamps) HWY_ATTR { return value(hn::Add(stamps, minus_age)); });
    *cell = now;
    batch.is_kept[i] = sum >= needed;
  }
}

void neighbour_support(const StampedBatch<Stamp>& batch, Stamp correlation_time, unsigned needed) {
  const auto one = hn::Set(typename Neighbours<1>::Lanes(), 1);
  find_support<1>(batch, correlation_time, needed,
                  [&](auto left) HWY_ATTR { return hn::AndNot(hn::ShiftRight<31>(left), one); });
}

void kernel_support(const StampedBatch<Stamp>& batch, Stamp correlation_time,
                    std::uint32_t needed) {
  find_support<kernel_radius>(batch, correlation_time, needed, [&](auto left) HWY_ATTR {
    return hn::AndNot(hn::ShiftRight<31>(left), left);
  });
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {
namespace {
HWY_EXPORT(neighbour_support);
HWY_EXPORT(kernel_support);
}  // namespace

void find_neighbour_support(const StampedBatch<Stamp>& batch, Stamp correlation_time,
                            unsigned needed) {
  HWY_DYNAMIC_DISPATCH(neighbour_support)(batch, correlation_time, needed);
}

void find_kernel_support(const StampedBatch<Stamp>& batch, Stamp correlation_time,
                         std::uint32_t needed) {
  HWY_DYNAMIC_DISPATCH(kernel_support)(batch, correlation_time, needed);
}

}  // namespace eventcamera
#endif
