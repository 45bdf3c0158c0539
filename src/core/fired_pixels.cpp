// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/fired_pixels.hpp"

#include "src/core/set_bits.hpp"

#define HWY_TARGET_INCLUDE "src/core/fired_pixels.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

using Places = hn::CappedTag<std::uint32_t, 8>;

/// Writes 8 events for a byte of pixels; only the first ones, one per fired pixel, are valid.
void write_byte(std::uint32_t first_place, unsigned fired, unsigned on, hn::Vec<Places> t,
                Event* out) {
  const Places places;
  const hn::Rebind<std::uint8_t, Places> bytes;
  const int lanes = static_cast<int>(hn::Lanes(places));
  const auto first = hn::Set(places, first_place);
  const auto ons = hn::Set(places, on);
  for (int i = 0; i < 8; i += lanes) {
    const auto bit = hn::PromoteTo(places, hn::LoadU(bytes, set_bits.of[fired] + i));
    const auto polarity =
        hn::And(hn::Shl(ons, hn::Set(places, 31) - bit), hn::Set(places, 0x80000000U));
    hn::StoreInterleaved2(t, hn::Or(first + bit, polarity), places,
                          reinterpret_cast<std::uint32_t*>(out + i));
  }
}

void write_groups(std::span<const FiredPixels::Group> groups, std::uint32_t time,
                  std::span<Event> events) {
  Event* out = events.data();
  Event* const end = out + events.size();
  const auto t = hn::Set(Places(), time);
  for (const auto& group : groups) {
    for (unsigned first = 0; first < 16; first += 8) {
      const unsigned fired = group.fired >> first & 0xffU;
      if (fired == 0) continue;
      const unsigned on = group.on >> first & 0xffU;
      const auto place = static_cast<std::uint32_t>(group.y) << 16 | (group.x + first);
      if (end - out >= 8) {
        write_byte(place, fired, on, t, out);
      } else {
        Event last[8];
        write_byte(place, fired, on, t, last);
        std::copy_n(last, std::popcount(fired), out);
      }
      out += std::popcount(fired);
    }
  }
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(write_groups);

void FiredPixels::write(std::span<const Group> groups, std::uint32_t t, std::span<Event> out) {
  HWY_DYNAMIC_DISPATCH(write_groups)(groups, t, out);
}

void FiredPixels::write_to(Event* out) const {
  write(groups(), t_, {out, size_});
}

}  // namespace eventcamera
#endif  // HWY_ONCE
