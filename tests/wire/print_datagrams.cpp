// SPDX-License-Identifier: LGPL-2.1-or-later
// Prints streams for datagram_decoder.py: their formats, datagrams and events.
#include <cinttypes>
#include <cstdio>

#include "tests/formats/random_events.hpp"
#include "tests/wire/datagrams.hpp"

using namespace eventcamera;

int main() {
  unsigned seed = 0;
  for (const SensorSize size : {SensorSize{128, 128}, {346, 260}, {1024, 512}}) {
    for (const auto& [name, settings] : datagrams::all(size.width, size.height)) {
      std::printf("stream %s %d %d\n", name.c_str(), size.width, size.height);
      const auto events = random_events::make(size, 5000, ++seed, 3'000'000'000, {40'000'000});
      for (const auto& packet : datagrams::packets_of(settings, events)) {
        std::printf("packet ");
        for (const unsigned byte : packet.bytes) std::printf("%02x", byte);
        std::printf("\n");
      }
      for (const auto& event : events)
        std::printf("event %" PRId64 " %d %d %d\n", event.t, event.x, event.y(),
                    event.polarity() == Polarity::on ? 1 : 0);
    }
  }
}
