// SPDX-License-Identifier: LGPL-2.1-or-later
// Datagrams of other tools.
//   RECORDING/FORMAT/pack, unpack   million events per second on one core, and bytes per event
//   loopback/FORMAT                 10 million events per second through sockets of this machine:
//                                   million events per second that were sent, percent that did not
//                                   arrive, and processors in use
//   growth/rate/FORMAT/RATE         the same at 1 to 40 million events per second
//   meson devenv -C build-bench bench/datagrams_bench
#include <benchmark/benchmark.h>

#include <memory>
#include <vector>

#include "bench/codec_timing.hpp"
#include "bench/loopback.hpp"
#include "tests/wire/datagrams.hpp"

namespace {

using namespace bench;

/// Formats that support the sensor; byte order and sequence numbers hardly affect speed.
std::vector<datagrams::Variant> formats_for(SensorSize size) {
  auto formats = datagrams::all(size.width, size.height);
  std::erase_if(formats, [&](const auto& variant) {
    return variant.name.ends_with("endian") || variant.name.ends_with("number") ||
           (variant.name == "jaer" && size.height > 512);
  });
  return formats;
}

void register_codecs(const Recording& recording) {
  if (recording.events.empty()) return;
  for (const auto& [name, settings] : formats_for(recording.size)) {
    const auto packets = std::make_shared<std::vector<datagrams::Packet>>(
        datagrams::packets_of(settings, recording.events));
    const auto label = recording.name + "/" + name;
    benchmark::RegisterBenchmark(
        (label + "/pack").c_str(), [&recording, packets, settings = settings](auto& state) {
          bench::measure(state, recording.events, [&] {
            const auto packer = make_datagram_packer(settings);
            packer->set_max_span(5000);
            const auto send = [](const Datagram& datagram) { benchmark::DoNotOptimize(datagram); };
            packer->pack(recording.events, send);
            packer->flush(send);
          });
          std::size_t bytes = 0;
          for (const auto& packet : *packets) bytes += packet.bytes.size();
          const auto count = static_cast<double>(recording.events.size());
          state.counters["bytes/event"] = static_cast<double>(bytes) / count;
          state.counters["events/datagram"] = count / static_cast<double>(packets->size());
        });
    benchmark::RegisterBenchmark((label + "/unpack").c_str(),
                                 [&recording, packets, settings = settings](auto& state) {
                                   std::vector<AbsoluteEvent> events;
                                   bench::measure(state, recording.events, [&] {
                                     const auto unpacker = make_datagram_unpacker(settings);
                                     for (const auto& packet : *packets) {
                                       unpacker->unpack(packet.bytes, packet.last, events);
                                       benchmark::DoNotOptimize(events.data());
                                     }
                                   });
                                 });
  }
}

}  // namespace

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  benchmark::Initialize(&argc, argv);
  const std::vector scenes{noise(), recorded("1280x720", "evt3-1280x720-triggers.raw"),
                           recorded("640x480", "evt3-640x480-triggers.raw")};
  for (const auto& scene : scenes) register_codecs(scene);
  for (const auto& [name, settings] : formats_for({640, 480})) {
    const auto from = "! eventdatagramdepay name=depay width=640 height=480 format=" + name;
    const auto payloader = "eventdatagrampay format=" + name;
    register_loopback("loopback/" + name, 10'000, from, payloader);
    register_growth(name, from, payloader);
  }
  benchmark::RunSpecifiedBenchmarks();
}
