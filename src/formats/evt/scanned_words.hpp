// SPDX-License-Identifier: LGPL-2.1-or-later
// What a scanner of EVT words has to know of each: a class per format, which reads one after the
// other.
#pragma once

#include <bit>
#include <cstdint>
#include <type_traits>

#include "src/formats/evt/cd_words.hpp"
#include "src/formats/evt/evt3_words.hpp"
#include "src/formats/evt/words.hpp"
#include "src/formats/unit_decoder.hpp"

namespace eventcamera {

/// Meaning of a word in its place.
struct ScannedWord {
  enum class Kind : std::uint8_t {
    time_high,  ///< with a count of the clock
    events,
    other,     ///< any word that belongs to the stream
    unplaced,  ///< events whose row, column or time is not known
    past,      ///< a time before the last one: data of an earlier transfer
    invalid,   ///< no camera writes this here
  };

  Kind kind = Kind::other;
  std::uint32_t count = 0;  ///< of the clock, or of events
};

/// Low 12 bits of the word, of type OTHERS, at the end of a transfer.
inline constexpr std::uint32_t end_marker = 0x019;

/// Words of EVT2, EVT2.1 and EVT4, which tell row and column of each event.
template <EvtFormat format>
class ScannedCdWords {
 public:
  using Word = std::conditional_t<format == EvtFormat::evt2 || format == EvtFormat::evt4,
                                  std::uint32_t, std::uint64_t>;
  static constexpr int clock_bits = 28;
  static constexpr int clock_shift = 6;

  explicit ScannedCdWords(SensorSize size) : bounds_(size, max_evt_side) {}

  /// The word in the order that decoders take.
  static constexpr Word in_order(Word word) {
    return static_cast<Word>(evt21::in_order<format>(word));
  }

  static constexpr bool is_end_marker(Word word) {
    return (upper(word).bits & 0xf0000fff) == (others << 28 | end_marker);
  }

  ScannedWord read(Word word) {
    using enum ScannedWord::Kind;
    if (mask_follows_) {
      mask_follows_ = false;
      return placed(vector_, static_cast<std::uint32_t>(word));
    }
    const auto cd = upper(word);
    const auto type = cd.type();
    if (type == types.time_high) return {time_high, cd.count()};
    if (is_event(type)) {
      low_ = cd.time_low();
      return placed(cd, format == EvtFormat::evt2 || format == EvtFormat::evt4
                            ? 1
                            : static_cast<std::uint32_t>(word));
    }
    if (format == EvtFormat::evt4 && (type == evt4::cd_vec_off || type == evt4::cd_vec_on)) {
      low_ = cd.time_low();
      vector_ = cd;
      mask_follows_ = true;
      return {bounds_.contain(cd.x(), cd.y()) ? other : invalid};
    }
    return {type == types.trigger || (types.ignored >> type & 1) != 0 ? other : invalid};
  }

  /// Low bits of the time of the last event.
  std::uint32_t event_low() const { return low_; }

  /// Low bits of the least time of later events, and of that before the last TIME_HIGH: cameras
  /// need not sort the events between two of them.
  static constexpr std::uint32_t low() { return 0; }
  static constexpr std::uint32_t low_before() { return 0; }

  void begin_transfer() {}
  static constexpr bool may_be_past() { return false; }

  /// Forgets the words before a gap.
  void interrupt() {
    mask_follows_ = false;
    low_ = 0;
  }

 private:
  static constexpr CdTypes types = format == EvtFormat::evt2   ? evt2::types
                                   : format == EvtFormat::evt4 ? evt4::types
                                                               : evt21::types;
  static constexpr std::uint32_t others =
      format == EvtFormat::evt4 ? std::uint32_t{evt4::others} : std::uint32_t{evt2::others};

  static constexpr CdWord upper(Word word) {
    return {static_cast<std::uint32_t>(sizeof(Word) == 8 ? std::uint64_t{word} >> 32 : word)};
  }

  static constexpr bool is_event(std::uint32_t type) {
    return format == EvtFormat::evt4 ? type == evt4::cd_off || type == evt4::cd_on
                                     : type <= evt2::cd_on;
  }

  ScannedWord placed(CdWord cd, std::uint32_t mask) const {
    const auto inside = mask & bounds_.of_32(cd.x(), cd.y());
    const auto kind =
        bounds_.contain(cd.x(), cd.y()) ? ScannedWord::Kind::events : ScannedWord::Kind::invalid;
    return {kind, static_cast<std::uint32_t>(std::popcount(inside))};
  }

  Bounds bounds_;
  CdWord vector_{};
  bool mask_follows_ = false;
  std::uint32_t low_ = 0;
};

/// Words of EVT3, which set row, columns and time for those that follow.
class ScannedEvt3Words {
 public:
  using Word = std::uint16_t;
  static constexpr int clock_bits = 12;
  static constexpr int clock_shift = 12;

  explicit ScannedEvt3Words(SensorSize size) : bounds_(size, max_evt_side) {}

  static constexpr Word in_order(Word word) { return word; }

  static constexpr bool is_end_marker(Word word) {
    return word == (evt3::others << 12 | end_marker);
  }

  ScannedWord read(Word word) {
    using enum ScannedWord::Kind;
    const std::uint32_t value = word & 0x7ff;
    switch (word >> 12) {
      case evt3::addr_y:
        has_row_ = bounds_.contain(0, value);
        return {has_row_ ? other : invalid};
      case evt3::em_addr_y:
        has_row_ = false;
        return {other};
      case evt3::addr_x:
        if (!bounds_.contain(value, 0)) return {invalid, 1};
        return {has_row_ && has_low_ ? events : unplaced, 1};
      case evt3::vect_base_x:
        has_base_ = bounds_.contain(value, 0);
        base_ = value;
        return {has_base_ ? other : invalid};
      case evt3::vect_12:
        return masked(word & 0xfff, 12);
      case evt3::vect_8:
        return masked(word & 0xff, 8);
      case evt3::time_low:
        return time_low(word & 0xfff);
      case evt3::time_high:
        // A new count resets the low bits.
        low_before_ = low_;
        if (const std::uint32_t count = word & 0xfff; count != high_) {
          has_low_ = high_ != none;
          high_ = count;
          low_ = 0;
          may_be_past_ = false;
        }
        return {time_high, high_};
      case evt3::ext_trigger:
        return {has_low_ ? other : unplaced};
      case evt3::others:
      case evt3::continued_4:
      case evt3::continued_12:
        return {other};
      default:
        return {word == evt3::padding ? other : invalid};
    }
  }

  std::uint32_t event_low() const { return low_; }
  std::uint32_t low() const { return low_; }
  std::uint32_t low_before() const { return low_before_; }

  /// Up to its first change of the high bits, a transfer may be an earlier one: its low bits, if
  /// they fall, tell.
  void begin_transfer() { may_be_past_ = true; }
  bool may_be_past() const { return may_be_past_; }

  void interrupt() {
    has_row_ = has_base_ = has_low_ = may_be_past_ = false;
    high_ = none;
    low_ = low_before_ = 0;
  }

 private:
  static constexpr std::uint32_t none = ~std::uint32_t{0};

  ScannedWord time_low(std::uint32_t low) {
    const bool is_past = may_be_past_ && has_low_ && low < low_;
    has_low_ = high_ != none;
    low_ = low;
    return {is_past ? ScannedWord::Kind::past : ScannedWord::Kind::other};
  }

  ScannedWord masked(std::uint32_t mask, std::uint32_t columns) {
    const bool is_placed = has_base_ && has_row_ && has_low_;
    const auto inside = is_placed ? mask & bounds_.of_32(base_, 0) : mask;
    // A vector goes on only after columns that were passed on.
    has_base_ = is_placed;
    base_ += columns;
    return {is_placed ? ScannedWord::Kind::events : ScannedWord::Kind::unplaced,
            static_cast<std::uint32_t>(std::popcount(inside))};
  }

  Bounds bounds_;
  std::uint32_t high_ = none;
  std::uint32_t low_ = 0;
  std::uint32_t low_before_ = 0;
  std::uint32_t base_ = 0;
  bool has_row_ = false;
  bool has_base_ = false;
  bool has_low_ = false;
  bool may_be_past_ = false;
};

}  // namespace eventcamera
