// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/difference.hpp"

#include <bit>
#include <cstdlib>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "src/simulate/difference.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

/// Maximum vector size, in words of 64 pixels.
constexpr int max_vector = (hn::MaxLanes(hn::ScalableTag<std::uint8_t>()) + 63) / 64;

/// A threshold in all lanes, clamped to the largest pixel value, which no difference exceeds.
template <class Pixel>
auto in_lanes(hn::ScalableTag<Pixel> pixels, int threshold) {
  return hn::Set(pixels, static_cast<Pixel>(std::min(
                             threshold, static_cast<int>(std::numeric_limits<Pixel>::max()))));
}

/// Collects the events of a row without a branch per event, and appends many at a time.
class RowEvents {
 public:
  RowEvents(int y, std::uint32_t t, std::vector<Event>& out) : y_(y), t_(t), out_(out) {}

  /// Bit i of `fired` is set if pixel x + i fired, bit i of `on` if its event is ON.
  void add(std::uint64_t fired, std::uint64_t on, int x) {
    if (size_ + 64 > capacity) flush();
    const FiredLanes tag;
    const int lanes = static_cast<int>(hn::Lanes(tag));
    const auto mask = [&](std::uint64_t bits) {
      return hn::LoadMaskBits(tag, reinterpret_cast<const std::uint8_t*>(&bits));
    };
    auto place = off_events(x, y_);
    for (; fired != 0; fired >>= lanes, on >>= lanes) {
      store_fired(place, mask(fired), mask(on), t_, events_ + size_);
      size_ += std::popcount(fired & ((std::uint64_t{1} << lanes) - 1));
      place = hn::Add(place, hn::Set(tag, static_cast<std::uint32_t>(lanes)));
    }
  }

  void flush() {
    out_.insert(out_.end(), events_, events_ + size_);
    size_ = 0;
  }

 private:
  static constexpr int capacity = 512;

  int y_;
  std::uint32_t t_;
  std::vector<Event>& out_;
  int size_ = 0;
  Event events_[capacity + 16];
};

template <class Pixel>
void fire_row(const Pixel* before, const Pixel* now, int width, int y, std::uint32_t t,
              const Thresholds& thresholds, std::vector<Event>& out) {
  const hn::ScalableTag<Pixel> pixels;
  const int lanes = static_cast<int>(hn::Lanes(pixels));
  const auto positive = in_lanes<Pixel>(pixels, thresholds.positive);
  const auto negative = in_lanes<Pixel>(pixels, thresholds.negative);
  const auto zero = hn::Zero(pixels);
  RowEvents events(y, t, out);
  const auto fire = [&](int x, auto a, auto b) {
    // Excess over the threshold.
    const auto rise = hn::SaturatedSub(hn::SaturatedSub(b, a), positive);
    const auto fall = hn::SaturatedSub(hn::SaturatedSub(a, b), negative);
    const auto fired = hn::Ne(hn::Or(rise, fall), zero);
    if (hn::AllFalse(pixels, fired)) return;
    std::uint64_t fired_bits[max_vector] = {};
    std::uint64_t on_bits[max_vector] = {};
    hn::StoreMaskBits(pixels, fired, reinterpret_cast<std::uint8_t*>(fired_bits));
    hn::StoreMaskBits(pixels, hn::Ne(rise, zero), reinterpret_cast<std::uint8_t*>(on_bits));
    for (int i = 0; i * 64 < lanes; ++i) events.add(fired_bits[i], on_bits[i], x + 64 * i);
  };
  int x = 0;
  for (; x + lanes <= width; x += lanes)
    fire(x, hn::LoadU(pixels, before + x), hn::LoadU(pixels, now + x));
  if (x < width)
    fire(x, load_first(pixels, before + x, width - x), load_first(pixels, now + x, width - x));
  events.flush();
}

void fire_row_8(const std::uint8_t* before, const std::uint8_t* now, int width, int y,
                std::uint32_t t, const Thresholds& thresholds, std::vector<Event>& out) {
  fire_row(before, now, width, y, t, thresholds, out);
}

void fire_row_16(const std::uint16_t* before, const std::uint16_t* now, int width, int y,
                 std::uint32_t t, const Thresholds& thresholds, std::vector<Event>& out) {
  fire_row(before, now, width, y, t, thresholds, out);
}

template <class Pixel>
ChangedColumns changed(const Pixel* before, const Pixel* now, int width, int threshold) {
  const hn::ScalableTag<Pixel> pixels;
  const int lanes = static_cast<int>(hn::Lanes(pixels));
  const auto limit = in_lanes<Pixel>(pixels, threshold);
  const auto none = [&](int x) {
    const auto a = hn::LoadU(pixels, before + x);
    const auto b = hn::LoadU(pixels, now + x);
    const auto difference = hn::Or(hn::SaturatedSub(a, b), hn::SaturatedSub(b, a));
    return hn::AllTrue(pixels, hn::Eq(hn::SaturatedSub(difference, limit), hn::Zero(pixels)));
  };
  const auto one = [&](int x) { return std::abs(now[x] - before[x]) > threshold; };
  int first = 0;
  while (first + lanes <= width && none(first)) first += lanes;
  while (first < width && !one(first)) ++first;
  int last = width;
  while (last - lanes >= first && none(last - lanes)) last -= lanes;
  while (last > first && !one(last - 1)) --last;
  return {first, last};
}

ChangedColumns changed_8(const std::uint8_t* before, const std::uint8_t* now, int width,
                         int threshold) {
  return changed(before, now, width, threshold);
}

ChangedColumns changed_16(const std::uint16_t* before, const std::uint16_t* now, int width,
                          int threshold) {
  return changed(before, now, width, threshold);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(fire_row_8);
HWY_EXPORT(fire_row_16);
HWY_EXPORT(changed_8);
HWY_EXPORT(changed_16);

void fire_differences(const std::uint8_t* before, const std::uint8_t* now, int width, int y,
                      std::uint32_t t, const Thresholds& thresholds, std::vector<Event>& out) {
  HWY_DYNAMIC_DISPATCH(fire_row_8)(before, now, width, y, t, thresholds, out);
}

void fire_differences(const std::uint16_t* before, const std::uint16_t* now, int width, int y,
                      std::uint32_t t, const Thresholds& thresholds, std::vector<Event>& out) {
  HWY_DYNAMIC_DISPATCH(fire_row_16)(before, now, width, y, t, thresholds, out);
}

ChangedColumns changed_columns(const std::uint8_t* before, const std::uint8_t* now, int width,
                               int threshold) {
  return HWY_DYNAMIC_DISPATCH(changed_8)(before, now, width, threshold);
}

ChangedColumns changed_columns(const std::uint16_t* before, const std::uint16_t* now, int width,
                               int threshold) {
  return HWY_DYNAMIC_DISPATCH(changed_16)(before, now, width, threshold);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
