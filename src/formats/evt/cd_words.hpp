// SPDX-License-Identifier: LGPL-2.1-or-later
// Layouts of the words of EVT2, EVT2.1 and EVT4.
#pragma once

#include <bit>
#include <cstdint>

#include "src/core/event.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/evt/raw.hpp"

namespace eventcamera {

/// Word of EVT2 or EVT4, or upper half of a word of EVT2.1.
struct CdWord {
  std::uint32_t bits;

  /// `time` is truncated to its low bits.
  static constexpr CdWord at(std::uint32_t type, std::uint64_t time, std::uint32_t x,
                             std::uint32_t y) {
    return {type << 28 | (static_cast<std::uint32_t>(time) & 63) << 22 | (x & 0x7ff) << 11 |
            (y & 0x7ff)};
  }
  /// `count` is in units of 64 microseconds.
  static constexpr CdWord time_high(std::uint32_t type, std::uint64_t count) {
    return {type << 28 | (static_cast<std::uint32_t>(count) & 0x0fffffff)};
  }

  constexpr std::uint32_t type() const { return bits >> 28; }
  constexpr std::uint32_t count() const { return bits & 0x0fffffff; }
  constexpr std::uint32_t time_low() const { return bits >> 22 & 63; }
  constexpr std::uint32_t x() const { return bits >> 11 & 0x7ff; }
  constexpr std::uint32_t y() const { return bits & 0x7ff; }

  /// `time`: the last TIME_HIGH. The polarity is the lowest bit of the type.
  constexpr AbsoluteEvent event(std::uint64_t time) const {
    return {static_cast<Microseconds>(time + time_low()), static_cast<std::uint16_t>(x()),
            static_cast<std::uint16_t>(y() | (type() & 1) << 15)};
  }

  static constexpr std::uint16_t max_trigger_id = 31;

  static constexpr CdWord of_trigger(std::uint32_t type, std::uint64_t time,
                                     const Trigger& trigger) {
    return {at(type, time, 0, 0).bits | std::uint32_t{trigger.id} << 8 |
            (trigger.rising ? 1U : 0U)};
  }

  constexpr Trigger trigger(std::uint64_t time) const {
    return {static_cast<Microseconds>(time + time_low()),
            static_cast<std::uint16_t>(bits >> 8 & max_trigger_id), (bits & 1) != 0};
  }
};

/// Types of words without events.
struct CdTypes {
  std::uint32_t time_high;
  std::uint32_t trigger;
  std::uint32_t ignored;  ///< one bit per type
};

/// Types of words, in their upper four bits.
namespace evt2 {

enum Type : std::uint32_t { cd_off, cd_on, imu = 0xd, others = 0xe, continued = 0xf };

/// Events before the first TIME_HIGH are ignored.
inline constexpr CdTypes types{
    .time_high = 0x8,
    .trigger = 0xa,
    .ignored = 1U << cd_off | 1U << cd_on | 1U << imu | 1U << others | 1U << continued};

}  // namespace evt2

namespace evt21 {

inline constexpr CdTypes types{
    .time_high = 0x8, .trigger = 0xa, .ignored = 1U << evt2::others | 1U << evt2::continued};

/// Between little-endian words and, for EVT21-legacy, those with the upper half first.
template <EvtFormat format>
constexpr std::uint64_t in_order(std::uint64_t word) {
  return format == EvtFormat::evt21_legacy ? std::rotl(word, 32) : word;
}

}  // namespace evt21

namespace evt4 {

enum Type : std::uint32_t {
  others = 0x6,
  continued = 0x7,
  cd_off = 0xa,
  cd_on = 0xb,
  cd_vec_off = 0xc,
  cd_vec_on = 0xd,
  padding = 0xf,
};

inline constexpr CdTypes types{
    .time_high = 0xe, .trigger = 0x9, .ignored = 1U << others | 1U << continued | 1U << padding};

}  // namespace evt4

}  // namespace eventcamera
