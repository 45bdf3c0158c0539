// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"

namespace recordings {

using namespace eventcamera;
using Random = std::mt19937_64;
using Bytes = std::vector<std::uint8_t>;
using Events = std::vector<AbsoluteEvent>;

inline int below(Random& random, int end) {
  return std::uniform_int_distribution<int>(0, end - 1)(random);
}

/// Typical events of cameras and simulators: noise, rows that fire at once, bursts, and pauses of
/// up to `max_pause`.
inline Events random_events(Random& random, SensorSize size, std::size_t count,
                            Microseconds max_pause) {
  Events events;
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

/// Exactly `count` events, none before `start`.
inline Events random_events(SensorSize size, std::size_t count, unsigned seed,
                            Microseconds start = 0, Microseconds max_pause = 10'000'000) {
  Random random(seed);
  auto events = random_events(random, size, count, max_pause);
  events.resize(count);
  for (auto& event : events) event.t += start;
  return events;
}

inline Bytes bytes_of(std::string_view text) {
  return {text.begin(), text.end()};
}

inline Bytes encode(Encoder& encoder, std::span<const AbsoluteEvent> events,
                    std::size_t at_once = SIZE_MAX) {
  Bytes bytes;
  for (; !events.empty(); events = events.subspan(std::min(at_once, events.size())))
    encoder.encode(events.first(std::min(at_once, events.size())), bytes);
  while (encoder.finish(bytes)) continue;
  return bytes;
}

/// Writes the patch of an encoder, as a seekable output does.
inline void apply_patch(const Encoder& encoder, Bytes& bytes) {
  if (const auto patch = encoder.patch())
    std::ranges::copy(patch->bytes, bytes.begin() + static_cast<std::ptrdiff_t>(patch->position));
}

/// Every piece has `size` bytes; 0: random sizes, many of them tiny.
inline std::vector<std::span<const std::uint8_t>> pieces_of(std::span<const std::uint8_t> bytes,
                                                            std::size_t size) {
  Random random(1);
  std::vector<std::span<const std::uint8_t>> pieces;
  while (!bytes.empty()) {
    const std::size_t wanted = size != 0           ? size
                               : random() % 4 == 0 ? 1 + random() % 20000
                                                   : 1 + random() % 40;
    pieces.push_back(bytes.first(std::min(wanted, bytes.size())));
    bytes = bytes.subspan(pieces.back().size());
  }
  return pieces;
}

struct Picture {
  Frame frame;
  Bytes pixels;
};

/// Complete output of a decoder.
struct Contents {
  Events events;
  std::vector<Picture> pictures;
  std::vector<Trigger> triggers;
  std::vector<ImuSample> imu_samples;

  void take_all(Decoder& decoder) {
    const auto append = [](const auto& some, auto& all) {
      all.insert(all.end(), some.begin(), some.end());
    };
    while (const auto item = decoder.next()) {
      if (const auto* const some = std::get_if<EventItem>(&*item)) {
        append(some->events, events);
      } else if (const auto* const picture = std::get_if<FrameItem>(&*item)) {
        const auto& frame = picture->frame;
        pictures.push_back({frame, {frame.pixels, frame.pixels + frame.stride * frame.height}});
      } else if (const auto* const edges = std::get_if<TriggerItem>(&*item)) {
        append(edges->triggers, triggers);
      } else {
        append(std::get<ImuItem>(*item).samples, imu_samples);
      }
    }
  }
};

/// Pushes everything, each piece in memory of its own.
inline Contents decode(Decoder& decoder, std::span<const std::uint8_t> bytes,
                       std::size_t piece = SIZE_MAX) {
  Contents contents;
  for (const auto part : pieces_of(bytes, piece)) {
    const Bytes copy(part.begin(), part.end());
    decoder.push(copy);
    contents.take_all(decoder);
  }
  decoder.drain();
  contents.take_all(decoder);
  return contents;
}

/// Events of a decoder; throws if its output differs between splits of these bytes.
template <class Make>
Events events_however_split(const Make& make, std::span<const std::uint8_t> bytes) {
  const auto outcome = [&](std::size_t piece) {
    const auto decoder = make();
    const auto contents = decode(*decoder, bytes, piece);
    const auto& corruption = decoder->corruption();
    return std::tuple(contents.events, contents.triggers, decoder->streams().front().size,
                      corruption.places, corruption.first_at, corruption.first, corruption.outside);
  };
  const auto whole = outcome(SIZE_MAX);
  for (const std::size_t piece : {1, 7, 4097, 0})
    if (outcome(piece) != whole)
      throw std::logic_error("other output for pieces of " + std::to_string(piece));
  return std::get<0>(whole);
}

/// A source that fails while it is broken.
class BreakableBytes final : public ByteSource {
 public:
  explicit BreakableBytes(Bytes bytes) : source_(std::move(bytes)) {}
  std::uint64_t size() const override { return source_.size(); }
  std::optional<std::size_t> read(std::uint64_t position,
                                  std::span<std::uint8_t> out) noexcept override {
    return is_broken ? std::nullopt : source_.read(position, out);
  }
  std::optional<std::span<const std::uint8_t>> piece(std::uint64_t position) override {
    return is_broken ? std::nullopt : source_.piece(position);
  }
  bool failed() const noexcept override { return is_broken; }

  bool is_broken = false;

 private:
  MemoryBytes source_;
};

/// Error of a decoder for a file; empty if it succeeds.
inline std::string refusal(Decoder& decoder, std::span<const std::uint8_t> bytes) {
  try {
    decode(decoder, bytes);
  } catch (const UnsupportedFormat& exception) {
    return exception.what();
  }
  return {};
}

}  // namespace recordings
