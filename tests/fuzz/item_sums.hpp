// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>

#include "src/formats/decoder.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

namespace fuzz {

/// Hash of all items of one kind.
class Sum {
 public:
  void add(std::uint64_t number) { sum_ = (sum_ ^ number) * 0x9E3779B97F4A7C15U + (sum_ >> 29); }

  void add(const EventItem& item) {
    for (const auto& event : item.events) {
      add(static_cast<std::uint64_t>(event.t));
      add(std::uint64_t{event.x} << 16 | event.y_p);
    }
  }
  void add(const FrameItem& item) {
    const auto& frame = item.frame;
    add(static_cast<std::uint64_t>(frame.t));
    for (std::ptrdiff_t i = 0; i < frame.stride * frame.height; ++i) add(frame.pixels[i]);
  }
  void add(const TriggerItem& item) {
    for (const auto& trigger : item.triggers) {
      add(static_cast<std::uint64_t>(trigger.t));
      add(std::uint64_t{trigger.id} << 1 | (trigger.rising ? 1U : 0U));
    }
  }
  void add(const ImuItem& item) {
    for (const auto& sample : item.samples) {
      add(static_cast<std::uint64_t>(sample.t));
      add(std::bit_cast<std::uint32_t>(sample.temperature));
      for (const auto& vector : {sample.acceleration, sample.rotation, sample.magnetic_field})
        for (const float number : vector) add(std::bit_cast<std::uint32_t>(number));
    }
  }
  void add(const Corruption& corruption) {
    add(corruption.places);
    add(corruption.first_at);
    add(corruption.outside);
  }

  friend bool operator==(const Sum&, const Sum&) = default;

 private:
  std::uint64_t sum_ = 0;
};

/// A hash per kind: in some formats, the interleaving of events and triggers may depend on the
/// split.
struct Sums {
  Sum events, pictures, triggers, imu_samples, rest;

  void add(const EventItem& item) { events.add(item); }
  void add(const FrameItem& item) { pictures.add(item); }
  void add(const TriggerItem& item) { triggers.add(item); }
  void add(const ImuItem& item) { imu_samples.add(item); }

  friend bool operator==(const Sums&, const Sums&) = default;
};

inline void take(Decoder& reader, Sums& sums) {
  while (const auto item = reader.next()) {
    std::visit([&](const auto& some) { sums.add(some); }, *item);
    if (const auto* const some = std::get_if<EventItem>(&*item)) {
      require(some->stream < reader.streams().size(), "events are of a stream");
      require_within(reader.streams()[some->stream].size, some->events);
    }
  }
}

/// Complete output of a decoder that is pushed, and then drained; nothing of a file that it
/// refuses.
inline Sums sums_of(Decoder& reader, std::span<const std::uint8_t> bytes, Pieces pieces) {
  Sums sums;
  try {
    in_pieces(bytes, pieces, [&](auto piece) {
      reader.push(piece);
      take(reader, sums);
    });
    reader.drain();
    take(reader, sums);
  } catch (const UnsupportedFormat&) {
    sums.rest.add(std::uint64_t{1});
    return sums;
  }
  sums.rest.add(reader.corruption());
  sums.rest.add(reader.streams().size());
  return sums;
}

}  // namespace fuzz
