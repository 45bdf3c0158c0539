// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "src/core/event.hpp"
#include "src/formats/byte_cursor.hpp"

namespace eventcamera {

/// How messages of a topic are serialized.
///
/// ros1: fields without padding (wiki.ros.org/msg,
/// wiki.ros.org/roscpp/Overview/MessagesSerialization). cdr: XCDR1 of OMG's DDS-XTypes 1.3,
/// section 7.4, little-endian, after an encapsulation header of four bytes, from which alignment
/// counts.
enum class RosSerialization : std::uint8_t { ros1, cdr };

/// Reads the fields of a serialized message. Past the end everything is 0 or empty.
class MessageCursor {
 public:
  MessageCursor(std::span<const std::uint8_t> message, RosSerialization serialization)
      : MessageCursor(ByteCursor(message), serialization) {}

  bool failed() const { return failed_ || fields_.failed(); }

  template <class Number>
  Number number() {
    if (is_cdr_) fields_.align(sizeof(Number));
    return fields_.number<Number>();
  }

  bool boolean() { return number<std::uint8_t>() != 0; }

  /// Nanoseconds, of seconds and nanoseconds of 32 bits each.
  std::uint64_t time() {
    const std::uint64_t seconds = number<std::uint32_t>();
    return seconds * 1'000'000'000 + number<std::uint32_t>();
  }

  /// In CDR, its size includes a final zero.
  std::string_view text() {
    if (is_cdr_) fields_.align(sizeof(std::uint32_t));
    auto text = fields_.text();
    if (is_cdr_ && text.ends_with('\0')) text.remove_suffix(1);
    return text;
  }

  std::span<const std::uint8_t> bytes() {
    if (is_cdr_) fields_.align(sizeof(std::uint32_t));
    return fields_.sized_bytes<std::uint32_t>();
  }

  /// Time of a std_msgs/Header, in nanoseconds.
  std::uint64_t header_stamp() {
    if (!is_cdr_) number<std::uint32_t>();  // its number
    const auto stamp = time();
    text();  // its frame
    return stamp;
  }

  std::span<const std::uint8_t> rest() const { return fields_.rest(); }

 private:
  MessageCursor(ByteCursor message, RosSerialization serialization)
      : is_cdr_(serialization == RosSerialization::cdr),
        failed_(is_cdr_ && !skip_encapsulation(message)),
        fields_(message.rest()) {}

  /// False unless little-endian XCDR1 follows.
  static bool skip_encapsulation(ByteCursor& message) {
    constexpr std::uint16_t little_endian_cdr = 0x0100;
    const auto scheme = message.number<std::uint16_t>();
    message.number<std::uint16_t>();  // options
    return !message.failed() && scheme == little_endian_cdr;
  }

  bool is_cdr_;
  bool failed_;
  ByteCursor fields_;
};

}  // namespace eventcamera
