// SPDX-License-Identifier: LGPL-2.1-or-later
// Bags: pushed in pieces, with random access, and played.
#include <limits>
#include <memory>

#include "src/formats/magic.hpp"
#include "src/formats/recording_reader.hpp"
#include "src/formats/ros/bag_decoder.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"
#include "tests/fuzz/item_sums.hpp"

namespace {

using namespace fuzz;

/// Seeks to the time of the last event, and reads the rest.
void seek(Decoder& reader, std::span<const std::uint8_t> bytes, Microseconds t) {
  const auto point = reader.seek_point_before(t);
  if (!point) return;
  reader.restart(*point);
  if (point->position < bytes.size())
    reader.push(bytes.subspan(static_cast<std::size_t>(point->position)));
  Sums sums;
  take(reader, sums);
  reader.drain();
  take(reader, sums);
}

void read_with_index(std::span<const std::uint8_t> bytes) {
  BagDecoder reader("");
  MemoryBytes source({bytes.begin(), bytes.end()});
  Sums sums;
  try {
    const bool reads_itself = reader.open(source);
    if (!reads_itself) {
      reader.push(bytes);
      take(reader, sums);
      reader.drain();
    }
    take(reader, sums);
    const auto last = reader.last_time();
    if (reads_itself) bytes = {};
    seek(reader, bytes, last.value_or(1'000'000));
    seek(reader, bytes, std::numeric_limits<Microseconds>::min());
  } catch (const UnsupportedFormat&) {
  }
}

/// Plays a file, whose streams may begin anywhere, and a part of it.
void play(std::span<const std::uint8_t> bytes) {
  constexpr Microseconds chunk_length = 10'000;
  MemoryBytes source({bytes.begin(), bytes.end()});
  RecordingReader recording([] { return std::make_unique<BagDecoder>(""); }, chunk_length);
  recording.open(source);
  const auto play_on = [&] {
    while (const auto output = recording.next()) {
      const auto* const chunk = std::get_if<RecordingReader::Chunk>(&*output);
      if (chunk == nullptr) continue;
      const auto size = recording.streams()[chunk->stream].info.size;
      for (const auto& event : chunk->events)
        require(event.x < size.width && event.y() < size.height, "events are within the sensor");
    }
  };
  try {
    play_on();
    recording.seek(recording.position() / 2, std::nullopt);
    play_on();
  } catch (const UnsupportedFormat&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span bytes(data, size);
  const auto outcome = [&](Pieces pieces) {
    BagDecoder reader("");
    return sums_of(reader, bytes, pieces);
  };
  // Of a corrupt page, SQLite at times gives what its memory held before.
  if (has_at(0, sqlite_magic, bytes))
    outcome({});
  else
    require_same_however_cut(bytes, outcome);
  read_with_index(bytes);
  play(bytes);
  return 0;
}
