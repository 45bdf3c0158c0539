// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/decoder.hpp"

/// Invariants of every decoder for arbitrary bytes.
namespace fuzz {

using namespace eventcamera;

inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", what);
  std::abort();
}

/// Split of bytes: maximum piece size, and seed of random sizes.
struct Pieces {
  std::size_t max_size = 0;  ///< 0: a single piece
  std::uint64_t chance = 0;
};

/// Returns `bytes` piece by piece. Sanitizers detect reads past the end of a piece, and of a piece
/// after its use.
template <class Take>
void in_pieces(std::span<const std::uint8_t> bytes, Pieces pieces, const Take& take) {
  const auto max_size =
      pieces.max_size == 0 ? bytes.size() : std::min(pieces.max_size, bytes.size());
  std::vector<std::uint8_t> memory(max_size);
  while (!bytes.empty()) {
    pieces.chance = pieces.chance * 6364136223846793005 + 1442695040888963407;
    const auto wanted = pieces.max_size == 0 ? max_size : 1 + (pieces.chance >> 33) % max_size;
    const auto piece = std::span(memory).last(std::min(wanted, bytes.size()));
    std::ranges::copy(bytes.first(piece.size()), piece.begin());
    take(std::span<const std::uint8_t>(piece));
    std::ranges::fill(piece, 0xa5);
    bytes = bytes.subspan(piece.size());
  }
}

/// Checks that `outcome_of(pieces)` is the same for a single piece as for small and large pieces.
template <class OutcomeOf>
void require_same_however_cut(std::span<const std::uint8_t> bytes, const OutcomeOf& outcome_of) {
  std::uint64_t chance = bytes.size();
  for (const auto byte : bytes) chance = chance * 1099511628211 + byte;
  const bool small = (chance >> 63) != 0;
  const Pieces pieces{small ? static_cast<std::size_t>(1 + (chance >> 33) % 40) : bytes.size(),
                      chance};
  require(outcome_of(pieces) == outcome_of(Pieces{}), "pieces make the same");
}

/// Calls `take(flags, packet)` for packets, each after two bytes with its size and one with flags.
template <class Take>
void for_each_packet(std::span<const std::uint8_t> bytes, const Take& take) {
  while (bytes.size() >= 3) {
    const auto size = static_cast<std::size_t>(bytes[0] | bytes[1] << 8);
    const int flags = bytes[2];
    bytes = bytes.subspan(3);
    const auto packet = bytes.first(std::min(size, bytes.size()));
    bytes = bytes.subspan(packet.size());
    // In memory of its own, so that sanitizers detect reads past its end.
    take(flags, std::vector<std::uint8_t>(packet.begin(), packet.end()));
  }
}

/// Number of events earlier than a previous one.
inline std::uint64_t unsorted(std::span<const AbsoluteEvent> events) {
  std::uint64_t count = 0;
  auto latest = std::numeric_limits<Microseconds>::min();
  for (const auto& event : events) {
    count += event.t < latest ? 1 : 0;
    latest = std::max(latest, event.t);
  }
  return count;
}

inline void require_within(SensorSize size, std::span<const AbsoluteEvent> events) {
  for (const auto& event : events)
    require(size.width == 0 || (event.x < size.width && event.y() < size.height),
            "events are within the sensor");
}

/// Checks that the same events are read again from the seek point before all events.
inline void require_restarts(EventDecoder& decoder, std::span<const std::uint8_t> bytes,
                             const Decoded& before) {
  const auto seek_point = decoder.seek_point_before(std::numeric_limits<Microseconds>::min());
  if (!seek_point) return;
  decoder.restart(*seek_point);
  Decoded again;
  decoder.decode(bytes.subspan(static_cast<std::size_t>(seek_point->position)), again);
  decoder.finish(again);
  require(again.events == before.events && again.triggers == before.triggers,
          "what is read anew is the same");
}

/// Complete output of a decoder. `events_per_byte`: maximum of the format.
template <class Make>
auto outcome(const Make& make, std::span<const std::uint8_t> bytes, Pieces pieces,
             std::size_t events_per_byte) {
  const auto decoder = make();
  Decoded decoded;
  std::string error;
  try {
    in_pieces(bytes, pieces, [&](auto piece) { decoder->decode(piece, decoded); });
    decoder->finish(decoded);
  } catch (const UnsupportedFormat& exception) {
    error = exception.what();
    require(!error.empty(), "an error says why");
  }
  const auto corruption = decoder->corruption();
  require((corruption.places == 0) == corruption.first.empty(), "corruption says what it is");
  require(corruption.first_at <= bytes.size(), "corruption is within the file");
  require(decoded.events.size() + decoded.triggers.size() <= bytes.size() * events_per_byte,
          "memory is bounded");
  require_within(decoder->size(), decoded.events);
  if (error.empty() && pieces.max_size == 0) {
    MemoryBytes file({bytes.begin(), bytes.end()});
    Decoded tail;
    decoder->decode_tail(file, tail);
    require(tail.events.size() <= decoded.events.size(), "the tail is a part of the file");
    require_within(decoder->size(), tail.events);
    require_restarts(*decoder, bytes, decoded);
  }
  return std::tuple(decoded.events, decoded.triggers, error, decoder->size(), corruption.places,
                    corruption.first_at, corruption.first, corruption.outside);
}

template <class Make>
void check_decoder(const Make& make, std::span<const std::uint8_t> bytes,
                   std::size_t events_per_byte) {
  require_same_however_cut(
      bytes, [&](Pieces pieces) { return outcome(make, bytes, pieces, events_per_byte); });
}

}  // namespace fuzz
