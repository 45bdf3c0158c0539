// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"

namespace recordings {

using namespace eventcamera;
using Random = std::mt19937_64;

inline int below(Random& random, int end) {
  return std::uniform_int_distribution<int>(0, end - 1)(random);
}

/// Typical events of cameras and simulators: noise, rows that fire at once, bursts, and pauses of
/// up to `max_pause`.
inline std::vector<AbsoluteEvent> random_events(Random& random, SensorSize size, std::size_t count,
                                                Microseconds max_pause) {
  std::vector<AbsoluteEvent> events;
  Microseconds t = below(random, 3) == 0 ? below(random, 100'000) : 0;
  const auto polarity = [&] { return below(random, 2) == 0 ? Polarity::off : Polarity::on; };
  while (events.size() < count) {
    switch (below(random, 6)) {
      case 0:  // a pause; most are short
        t += static_cast<Microseconds>(std::pow(
            static_cast<double>(max_pause), std::uniform_real_distribution<double>(0, 1)(random)));
        break;
      case 1: {  // noise
        for (int i = below(random, 30); i > 0; --i, t += below(random, 50))
          events.push_back(AbsoluteEvent::at(below(random, size.width), below(random, size.height),
                                             t, polarity()));
        break;
      }
      case 2: {  // a row, dense or not
        const int y = below(random, size.height);
        const int stride = 1 + below(random, 4);
        const auto row_polarity = polarity();
        const int end = std::min(size.width, below(random, 2 * size.width) + 1);
        for (int x = below(random, size.width); x < end; x += 1 + below(random, stride))
          events.push_back(AbsoluteEvent::at(x, y, t, row_polarity));
        break;
      }
      case 3: {  // the right edge
        const int y = below(random, size.height);
        for (int x = std::max(0, size.width - 1 - below(random, 40)); x < size.width; ++x)
          events.push_back(AbsoluteEvent::at(x, y, t, Polarity::on));
        break;
      }
      case 4:  // both polarities in the order of columns
        for (int i = 0, x = 0; i < 20 && x < size.width; ++i, x += 1 + below(random, 3))
          events.push_back(AbsoluteEvent::at(x, 0, t, polarity()));
        break;
      default:  // the same pixel, again and again
        for (int i = 0; i < 3; ++i)
          events.push_back(AbsoluteEvent::at(size.width - 1, size.height - 1, t, Polarity::off));
        t += 1 + below(random, 5000);
    }
  }
  return events;
}

inline std::vector<std::uint8_t> encode(Encoder& encoder, std::span<const AbsoluteEvent> events) {
  std::vector<std::uint8_t> bytes;
  encoder.encode(events, bytes);
  while (encoder.finish(bytes)) continue;
  return bytes;
}

/// Decodes everything, in pieces of `next_piece()` bytes.
template <class NextPiece>
Decoded decode(EventDecoder& decoder, std::span<const std::uint8_t> bytes,
               const NextPiece& next_piece) {
  Decoded decoded;
  while (!bytes.empty()) {
    const auto piece = bytes.first(std::min<std::size_t>(bytes.size(), next_piece()));
    decoder.decode(piece, decoded);
    bytes = bytes.subspan(piece.size());
  }
  decoder.finish(decoded);
  return decoded;
}

inline Decoded decode(EventDecoder& decoder, std::span<const std::uint8_t> bytes) {
  return decode(decoder, bytes, [&] { return bytes.size(); });
}

/// Error of a decoder for a file; empty if it succeeds.
inline std::string refusal(EventDecoder& decoder, std::span<const std::uint8_t> bytes) {
  try {
    decode(decoder, bytes);
  } catch (const UnsupportedFormat& exception) {
    return exception.what();
  }
  return {};
}

}  // namespace recordings
