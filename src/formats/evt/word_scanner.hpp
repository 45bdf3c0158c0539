// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/evt/raw.hpp"

namespace eventcamera {

/// How a camera's words arrive.
enum class Framing : std::uint8_t {
  loose,   ///< bytes in pieces of any size, some of which may be missing
  padded,  ///< transfers of whole words up to an end marker, past which are old bytes
};

/// Finds the valid EVT words in the data of a live camera. Words are passed on in stretches: from a
/// TIME_HIGH to the next, which must continue the clock, without invalid words in between. All
/// others are lost, and counted. After a gap, a stretch must be complete before it is passed on;
/// events that depend on a word before the gap are dropped.
///
/// The end marker of a padded transfer, or the end of its bytes, also ends a stretch. A transfer
/// that begins before the end of the last one is an old one, unless the next one continues it: then
/// the camera started over, and the first is lost.
class WordScanner {
 public:
  struct Transfer {
    std::span<const std::uint8_t> bytes;
    bool is_discontinuous = false;        ///< data is missing before it
    std::optional<Microseconds> elapsed;  ///< since the transfer before, by another clock
  };

  /// Valid words, in the byte order that decoders read. Times are the camera's, unwrapped, and
  /// equal to the times of the words modulo 2^24 microseconds, the range of the shortest clock.
  struct Piece {
    std::vector<std::uint8_t> words;
    Microseconds start = 0;         ///< no event is earlier
    Microseconds end = 0;           ///< no event of the following pieces is earlier
    bool is_discontinuous = false;  ///< otherwise it starts at the end of the last piece
  };

  struct Counts {
    std::uint64_t bytes = 0;        ///< passed on
    std::uint64_t events = 0;       ///< passed on
    std::uint64_t lost_bytes = 0;   ///< received, but not passed on; without padding
    std::uint64_t lost_events = 0;  ///< in lost bytes that can be decoded
    std::uint64_t gaps = 0;         ///< discontinuous pieces, except the first
  };

  virtual ~WordScanner() = default;
  WordScanner(const WordScanner&) = delete;
  WordScanner& operator=(const WordScanner&) = delete;

  /// Appends the pieces that a transfer completes.
  virtual void scan(const Transfer& transfer, std::vector<Piece>& out) = 0;

  /// Declares the end: appends the last piece.
  virtual void finish(std::vector<Piece>& out) = 0;

  const Counts& counts() const { return counts_; }

 protected:
  WordScanner() = default;

  Counts counts_;
};

std::unique_ptr<WordScanner> make_word_scanner(EvtFormat format, SensorSize size, Framing framing);

}  // namespace eventcamera
