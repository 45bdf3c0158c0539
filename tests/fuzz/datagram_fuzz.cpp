// SPDX-License-Identifier: LGPL-2.1-or-later
// The first byte selects a format. Datagrams follow, each after two bytes with its size and one
// with the time until its arrival.
#include "tests/fuzz/fuzz_decoder.hpp"
#include "tests/wire/datagrams.hpp"

namespace {

using namespace eventcamera;
using fuzz::require;

/// Least bytes of an event, of any format.
constexpr std::size_t min_event_size = 4;

void require_valid(const DatagramSettings& settings, const Reception& reception,
                   std::span<const AbsoluteEvent> events, std::size_t size, Microseconds latest) {
  require(events.size() <= size / min_event_size, "memory is bounded");
  require(events.empty() || (reception.fault == nullptr && !reception.late),
          "a rejected datagram has no events");
  fuzz::require_within({settings.width, settings.height}, events);
  require(fuzz::unsorted(events) == 0, "events are sorted");
  if (events.empty()) return;
  require(events.front().t >= (reception.restarted ? 0 : latest), "time does not go back");
  require(events.back().t <= std::numeric_limits<Nanoseconds>::max() / 1000,
          "times fit into nanoseconds");
  require(events.back().t - events.front().t <= max_interval / 1000, "times fit into an event");
}

/// Checks that what was read is written such that the same is read.
void require_same_again(const DatagramSettings& settings, std::vector<AbsoluteEvent> events) {
  if (settings.format == DatagramFormat::spif) return;  // it has no times
  const auto unpacker = make_datagram_unpacker(settings);
  std::vector<AbsoluteEvent> again;
  std::vector<AbsoluteEvent> part;
  for (const auto& packet : datagrams::packets_of(settings, events)) {
    unpacker->unpack(packet.bytes, packet.first, part);
    again.insert(again.end(), part.begin(), part.end());
  }
  require(again.size() == events.size(), "what is written is read");
  // The first time of 32 bits does not tell how often they wrapped.
  const auto wraps = events.empty() ? 0 : events.front().t - again.front().t;
  require((wraps & 0xffff'ffff) == 0, "times are equal but for wraps");
  for (auto& event : again) event.t += wraps;
  require(again == events, "what is written is read as it was");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto formats = datagrams::all();
  const std::span bytes(data, size);
  if (bytes.empty()) return 0;
  const auto& settings = formats[bytes[0] % formats.size()].settings;
  const auto unpacker = make_datagram_unpacker(settings);
  std::vector<AbsoluteEvent> events;
  Microseconds latest = 0;
  Microseconds arrival = 0;
  fuzz::for_each_packet(bytes.subspan(1), [&](int flags, const auto& datagram) {
    arrival += Microseconds{1} << flags % 40;
    const auto reception = unpacker->unpack(datagram, arrival, events);
    require_valid(settings, reception, events, datagram.size(), latest);
    if (!events.empty()) latest = events.back().t;
    require_same_again(settings, events);
  });
  return 0;
}
