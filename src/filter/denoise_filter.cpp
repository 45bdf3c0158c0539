// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/denoise_filter.hpp"

#include <cmath>

#include "src/core/sensor_size.hpp"

#define HWY_TARGET_INCLUDE "src/filter/denoise_filter.cpp"
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
        column = column + (value(stamps(cell, first, -y)) + value(stamps(cell, first, y)));
      const auto beside = value(stamps(cell, first, 0));
      total = total + hn::And(column, hn::LoadU(lanes, in_square + first));
      total = total + hn::And(beside, hn::LoadU(lanes, beside_centre + first));
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

/// Keeps the events of a batch whose neighbours' sum of value(left) is at least `needed`, and
/// stamps their pixels. `left` is the remaining correlation time, negative once it has passed.
/// Cells need a margin of `radius`.
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
    const auto sum =
        neighbours.sum(cell, [&](auto stamps) HWY_ATTR { return value(stamps + minus_age); });
    *cell = now;
    batch.is_kept[i] = sum >= needed;
  }
}

/// Keeps an event if at least `needed` of 8 neighbours fired within the correlation time.
void neighbour_support(const StampedBatch<Stamp>& batch, Stamp correlation_time, unsigned needed) {
  const auto one = hn::Set(typename Neighbours<1>::Lanes(), 1);
  find_support<1>(batch, correlation_time, needed,
                  [&](auto left) HWY_ATTR { return hn::AndNot(hn::ShiftRight<31>(left), one); });
}

/// Keeps an event if the remaining correlation times of 24 neighbours add up to at least `needed`;
/// the sum must fit into 31 bits.
void kernel_support(const StampedBatch<Stamp>& batch, Stamp correlation_time,
                    std::uint32_t needed) {
  find_support<DenoiseFilter::kernel_radius>(
      batch, correlation_time, needed,
      [&](auto left) HWY_ATTR { return hn::AndNot(hn::ShiftRight<31>(left), left); });
}

int nearest(const DoubleWindow::Window& signal, const DoubleWindow::Window& noise, int x, int y) {
  const hn::CappedTag<std::int16_t, 16> lanes;
  const auto at_x = hn::Set(lanes, static_cast<std::int16_t>(x));
  const auto at_y = hn::Set(lanes, static_cast<std::int16_t>(y));
  auto min = hn::Set(lanes, INT16_MAX);
  for (const auto* window : {&signal, &noise})
    for (std::size_t i = 0; i < window->x.size(); i += hn::Lanes(lanes)) {
      const auto across = hn::Abs(hn::LoadU(lanes, window->x.data() + i) - at_x);
      const auto down = hn::Abs(hn::LoadU(lanes, window->y.data() + i) - at_y);
      min = hn::Min(min, hn::SaturatedAdd(across, down));
    }
  return hn::GetLane(hn::MinOfLanes(lanes, min));
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {
namespace {
HWY_EXPORT(neighbour_support);
HWY_EXPORT(kernel_support);
HWY_EXPORT(nearest);
}  // namespace

void DoubleWindow::clear() {
  for (auto* window : {&signal_, &noise_}) {
    window->x.fill(-max_side);
    window->y.fill(-max_side);
    window->next = 0;
  }
}

LabelledEvents DoubleWindow::filter(LabelledEvents events, unsigned distance) {
  return events.keep_if([&](const Event& event) {
    const int found = HWY_DYNAMIC_DISPATCH(nearest)(signal_, noise_, event.x, event.y());
    const bool is_signal = found <= static_cast<int>(distance);
    (is_signal ? signal_ : noise_).add(event);
    return is_signal;
  });
}

Nanoseconds DenoiseFilter::default_correlation_time(DenoiseMethod method) {
  switch (method) {
    case DenoiseMethod::baf:
      return 2'000'000;
    case DenoiseMethod::stcf:
      return 25'000'000;
    case DenoiseMethod::time_kernel:
      return 32'000'000;
    case DenoiseMethod::dwf:
      break;
  }
  return 0;
}

LabelledEvents DenoiseFilter::filter(LabelledEvents events, Microseconds start,
                                     const Settings& settings) {
  if (settings.method == DenoiseMethod::dwf) {
    pixels_.reset();
    return window_.filter(events, settings.search_distance);
  }
  window_.clear();
  const Stamp correlation_time =
      in_stamps(settings.correlation_time != 0 ? settings.correlation_time
                                               : default_correlation_time(settings.method));
  if (settings.method == DenoiseMethod::time_kernel) {
    const auto needed =
        static_cast<std::uint32_t>(std::ceil(settings.threshold * correlation_time));
    return pixels(kernel_radius, true).keep_batches(events, start, [&](const auto& batch) {
      HWY_DYNAMIC_DISPATCH(kernel_support)(batch, correlation_time, needed);
    });
  }
  const unsigned needed = settings.method == DenoiseMethod::baf ? 1 : settings.min_neighbours;
  return pixels(1, settings.match_polarity).keep_batches(events, start, [&](const auto& batch) {
    HWY_DYNAMIC_DISPATCH(neighbour_support)(batch, correlation_time, needed);
  });
}

StampedPixels<Stamp>& DenoiseFilter::pixels(int margin, bool match_polarity) {
  if (!pixels_ || margin != margin_ || match_polarity != match_polarity_) {
    pixels_.reset();  // first, for its memory
    pixels_.emplace(sensor_, margin,
                    match_polarity ? CellsPerPixel::one_per_polarity : CellsPerPixel::one);
    margin_ = margin;
    match_polarity_ = match_polarity;
  }
  return *pixels_;
}

void DenoiseFilter::forget() {
  if (pixels_) pixels_->forget();
  window_.clear();
}

}  // namespace eventcamera
#endif  // HWY_ONCE
