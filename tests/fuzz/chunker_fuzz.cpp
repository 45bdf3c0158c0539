// SPDX-License-Identifier: LGPL-2.1-or-later
// Cuts events at arbitrary times into intervals. Four bytes are an event or a command.
#include "src/formats/chunker.hpp"

#include <algorithm>
#include <optional>

#include "src/core/byte_order.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

namespace {

using namespace fuzz;

AbsoluteEvent numbered(std::uint64_t number, std::uint64_t t) {
  return {static_cast<Microseconds>(t), static_cast<std::uint16_t>(number),
          static_cast<std::uint16_t>(number >> 16)};
}

std::uint32_t number_of(const Event& event) {
  return static_cast<std::uint32_t>(event.y_p) << 16 | event.x;
}

std::uint64_t take(Chunker& chunker, std::optional<Microseconds>& end) {
  std::uint64_t count = 0;
  while (const auto interval = chunker.next()) {
    require(!end || interval->start == *end, "an interval begins where the last one ended");
    require(interval->duration > 0 || !interval->events.empty(), "an interval is not empty");
    end = interval->start + interval->duration;
    const Event* before = nullptr;
    for (const auto& event : interval->events) {
      require(event.t < std::max<Microseconds>(interval->duration, 1),
              "events are within their interval");
      require(before == nullptr || before->t < event.t ||
                  (before->t == event.t && number_of(*before) < number_of(event)),
              "events are sorted, and those of a time are in the order in which they came");
      before = &event;
    }
    count += interval->events.size();
  }
  return count;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Chunker chunker(1 + size % 2000);
  std::optional<Microseconds> end;
  std::vector<AbsoluteEvent> events;
  std::uint64_t pushed = 0;
  std::uint64_t taken = 0;
  std::uint64_t t = 0;
  for (; size >= 4; data += 4, size -= 4) {
    const int shift = data[0] % 64;
    const auto step = static_cast<std::uint64_t>(little_endian<std::int16_t>(data + 1)) << shift;
    switch (data[3] % 8) {
      case 0:
        chunker.push(events);
        pushed += events.size();
        events.clear();
        break;
      case 1:
        taken += take(chunker, end);
        break;
      case 2:
        chunker.advance_to(static_cast<Microseconds>(t + step));
        break;
      case 3:
        chunker.pause(static_cast<Microseconds>(t + step));
        break;
      default:
        t += step;
        events.push_back(numbered(pushed + events.size(), t));
    }
  }
  chunker.push(events);
  pushed += events.size();
  chunker.finish();
  taken += take(chunker, end);
  const auto dropped = chunker.dropped();
  require(taken + dropped.late + dropped.stray == pushed, "no event is lost");
  return 0;
}
