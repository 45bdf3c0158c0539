// SPDX-License-Identifier: LGPL-2.1-or-later
// AEDAT recordings, made and read by the encoder and decoder alone.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <variant>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_encoder.hpp"
#include "tests/formats/aedat_files.hpp"

namespace aedat_recordings {

using namespace eventcamera;
using Bytes = std::vector<std::uint8_t>;
using Events = std::vector<AbsoluteEvent>;

inline constexpr SensorSize sensor{346, 260};
/// Start time of a recording with absolute times.
inline constexpr Microseconds of_1970 = 1'700'000'000'000'000;

inline Events shifted(Events events, Microseconds by) {
  for (auto& event : events) event.t += by;
  return events;
}

inline Events from(const Events& events, Microseconds t) {
  Events later;
  for (const auto& event : events)
    if (event.t >= t) later.push_back(event);
  return later;
}

/// Events at all times from 0 to `end`, one every `step` microseconds.
inline Events steady_events(Microseconds end, Microseconds step, Microseconds start = 0) {
  Events events;
  for (Microseconds t = 0; t < end; t += step) {
    const auto i = static_cast<int>(t / step);
    events.push_back(AbsoluteEvent::at(i % sensor.width, i / 7 % sensor.height, start + t,
                                       i % 3 == 0 ? Polarity::on : Polarity::off));
  }
  return events;
}

/// A file with a table that is stated in its header.
inline Bytes finished(Aedat4Encoder& encoder, Bytes bytes) {
  encoder.finish(bytes);
  if (const auto patch = encoder.patch())
    std::copy(patch->bytes.begin(), patch->bytes.end(),
              bytes.begin() + static_cast<std::ptrdiff_t>(patch->position));
  return bytes;
}

inline Bytes aedat4_file(const Events& events,
                         Aedat4Compression compression = Aedat4Compression::lz4,
                         bool table = true) {
  Aedat4Encoder encoder({sensor, "a camera", compression, false, table});
  Bytes bytes;
  encoder.encode(events, bytes);
  return finished(encoder, bytes);
}

/// Events, and a frame every 40 ms whose pixels contain its number; the first is before the events.
inline Bytes aedat4_with_frames(const Events& events, PixelFormat format, int frames) {
  Aedat4Encoder encoder({sensor, "", Aedat4Compression::zstd, true, true});
  Bytes bytes;
  std::span<const AbsoluteEvent> rest(events);
  for (int i = 0; i < frames; ++i) {
    const auto t = events.front().t - 3'000 + i * 40'000;
    std::size_t count = 0;
    while (count < rest.size() && rest[count].t < t) ++count;
    encoder.encode(rest.first(count), bytes);
    rest = rest.subspan(count);
    const Bytes pixels(static_cast<std::size_t>(5 * 3 * bytes_per_pixel(format)),
                       static_cast<std::uint8_t>(i));
    encoder.encode({t, t, t, t, t, format, 5, 3, 0, 0, pixels.data(), 5 * bytes_per_pixel(format)},
                   bytes);
  }
  encoder.encode(rest, bytes);
  return finished(encoder, bytes);
}

/// Content of a file, as the decoder alone reads it.
struct Content {
  struct Picture {
    std::array<Microseconds, 5> times;  ///< of the frame, its begin, end, and exposure
    std::array<int, 4> box;             ///< its size and place
    Bytes pixels;

    friend bool operator==(const Picture&, const Picture&) = default;
  };

  explicit Content(const Bytes& bytes) {
    const auto decoder = make_aedat4_decoder();
    decoder->push(bytes);
    decoder->drain();
    const auto append = [](auto& to, const auto& more) {
      to.insert(to.end(), more.begin(), more.end());
    };
    while (const auto item = decoder->next()) {
      if (const auto* const of_events = std::get_if<EventItem>(&*item)) {
        append(events, of_events->events);
      } else if (const auto* const of_triggers = std::get_if<TriggerItem>(&*item)) {
        append(triggers, of_triggers->triggers);
      } else if (const auto* const of_imu = std::get_if<ImuItem>(&*item)) {
        append(imu_samples, of_imu->samples);
      } else if (const auto* const of_frame = std::get_if<FrameItem>(&*item)) {
        const auto& f = of_frame->frame;
        pictures.push_back({{f.t, f.begin, f.end, f.exposure_begin, f.exposure_end},
                            {f.width, f.height, f.x, f.y},
                            {f.pixels, f.pixels + f.height * f.stride}});
      }
    }
    EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;
    streams = decoder->streams();
    const auto header = read_aedat4_header(bytes).value();
    has_table = header.table_at.has_value();
    compression = header.compression;
  }

  Events events;
  std::vector<Picture> pictures;
  std::vector<Trigger> triggers;
  std::vector<ImuSample> imu_samples;
  bool has_table = false;
  std::vector<StreamInfo> streams;
  Aedat4Compression compression = Aedat4Compression::none;
};

}  // namespace aedat_recordings
