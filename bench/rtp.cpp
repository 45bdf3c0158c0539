// SPDX-License-Identifier: LGPL-2.1-or-later
// Events in RTP packets.
//   RECORDING/FORMAT/pack, unpack   million events per second on one core, and bytes per event
//   loopback/FORMAT                 20 million events per second through sockets of this machine:
//                                   million events per second that were sent, percent that did not
//                                   arrive, and processors in use
//   growth/rate/FORMAT/RATE         the same at 1 to 40 million events per second
//   growth/mtu/FORMAT/MTU           the same at 20 million, for other sizes of packets
//   latency                         one million events per second, likewise: milliseconds from a
//                                   buffer's arrival at the payloader until its events leave the
//                                   depayloader, median and 99th percentile
//   meson devenv -C build-bench bench/rtp_bench
#include <algorithm>
#include <array>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "bench/codec_timing.hpp"
#include "bench/loopback.hpp"
#include "src/wire/rtp_packer.hpp"
#include "src/wire/rtp_unpacker.hpp"

namespace {

using namespace bench;

constexpr std::array formats = {"EVT3", "XYTP"};
/// Payload of a packet of 1400 bytes.
constexpr std::size_t max_size = 1388;
constexpr Microseconds interval = 10'000;

struct Packet {
  bool marker;
  std::vector<std::uint8_t> payload;
};

/// Calls take(start, events) for each interval of a recording.
template <class Take>
void for_each_interval(const std::vector<AbsoluteEvent>& events, const Take& take) {
  std::vector<Event> some;
  for (std::size_t i = 0; i < events.size();) {
    const auto start = events[i].t;
    some.clear();
    for (; i < events.size() && events[i].t < start + interval; ++i)
      some.push_back({static_cast<std::uint32_t>(events[i].t - start), events[i].x, events[i].y_p});
    take(start * 1000, some);
  }
}

void register_codec(const Recording& recording, RtpEventFormat format, const std::string& name) {
  const auto pack = [&recording, format](const auto& take) {
    RtpPacker packer(recording.size, format);
    PendingInterval pending(recording.size);
    for_each_interval(recording.events, [&](Nanoseconds start, const std::vector<Event>& events) {
      pending.add(start, start + interval * 1000, events, [] {});
      packer.pack(start, interval * 1000, pending.events(), max_size, take);
      pending.clear();
    });
  };
  const auto packets = std::make_shared<std::vector<Packet>>();
  pack([&](std::span<const std::uint8_t> payload, bool is_last) {
    packets->push_back({is_last, {payload.begin(), payload.end()}});
  });
  const auto label = recording.name + "/" + name;
  benchmark::RegisterBenchmark((label + "/pack").c_str(), [=, &recording](auto& state) {
    measure(state, recording.events, [&] {
      pack([](std::span<const std::uint8_t> payload, bool) {
        benchmark::DoNotOptimize(payload.data());
      });
    });
    std::size_t bytes = 0;
    for (const auto& packet : *packets) bytes += packet.payload.size();
    const auto count = static_cast<double>(recording.events.size());
    state.counters["bytes/event"] = static_cast<double>(bytes) / count;
    state.counters["events/packet"] = count / static_cast<double>(packets->size());
  });
  benchmark::RegisterBenchmark((label + "/unpack").c_str(), [=, &recording](auto& state) {
    measure(state, recording.events, [&] {
      RtpUnpacker unpacker(recording.size, format);
      std::uint16_t number = 0;
      for (const auto& packet : *packets)
        unpacker.push(
            {1, number++, packet.marker, packet.payload},
            [](const RtpInterval& received) { benchmark::DoNotOptimize(received.events.data()); });
    });
  });
}

const std::string depayloader =
    "caps=application/x-rtp,media=application,clock-rate=1000000,encoding-name=X-EVENT-CAMERA,"
    "width=640,height=480,format=";

std::string from(const std::string& format) {
  return depayloader + format + " ! rtpeventdepay name=depay";
}

/// Wall-clock times of the buffers of a second: when each was pushed, and when its events arrived.
struct Arrivals {
  std::array<Clock::time_point, 1000> pushed;
  std::vector<double> milliseconds;  ///< of each event
  std::mutex mutex;

  void take(GstBuffer* buffer) {
    const auto now = Clock::now();
    const std::lock_guard lock(mutex);
    const auto first = GST_BUFFER_PTS(buffer) / GST_MSECOND;
    GstMapInfo map;
    gst_buffer_map(buffer, &map, GST_MAP_READ);
    const std::span events(reinterpret_cast<const Event*>(map.data), map.size / sizeof(Event));
    for (const auto& event : events)
      milliseconds.push_back(
          std::chrono::duration<double, std::milli>(now - pushed[first + event.t / 1000]).count());
    gst_buffer_unmap(buffer, &map);
  }
};

void latency(benchmark::State& state) {
  const auto receiver = receive(from("EVT3"));
  const auto sender = send_to(receiver, "rtpeventpay");
  Arrivals arrivals;
  GstPad* pad = gst_element_get_static_pad(receiver.named("depay"), "src");
  gst_pad_add_probe(
      pad, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo* info, gpointer to) {
        static_cast<Arrivals*>(to)->take(GST_PAD_PROBE_INFO_BUFFER(info));
        return GST_PAD_PROBE_OK;
      },
      &arrivals, nullptr);
  gst_object_unref(pad);
  for (auto _ : state) {
    send(GST_APP_SRC(sender.named("source")), 1000, [&](int i) {
      const std::lock_guard lock(arrivals.mutex);
      arrivals.pushed[static_cast<std::size_t>(i)] = Clock::now();
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
  const std::lock_guard lock(arrivals.mutex);
  auto& all = arrivals.milliseconds;
  if (all.empty()) return state.SkipWithError("nothing arrived");
  std::ranges::sort(all);
  state.counters["p50-ms"] = all[all.size() / 2];
  state.counters["p99-ms"] = all[all.size() * 99 / 100];
  state.counters["lost%"] = 100 * (1 - static_cast<double>(all.size()) / 1e6);
}

}  // namespace

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  benchmark::Initialize(&argc, argv);
  const std::vector scenes{noise(), recorded("1280x720", "evt3-1280x720-triggers.raw"),
                           recorded("640x480", "evt3-640x480-triggers.raw")};
  for (std::size_t i = 0; i < formats.size(); ++i) {
    const std::string name = formats[i];
    for (const auto& scene : scenes)
      if (!scene.events.empty()) register_codec(scene, static_cast<RtpEventFormat>(i), name);
    const auto payloader = "rtpeventpay format=" + name;
    register_loopback("loopback/" + name, 20'000, from(name), payloader);
    register_growth("RTP " + name, from(name), payloader);
    for (const auto* mtu : {"576", "1400", "8972", "65507"})
      register_loopback("growth/mtu/RTP " + name + "/" + mtu, 20'000,
                        std::string("mtu=") + mtu + " " + from(name), payloader + " mtu=" + mtu);
  }
  benchmark::RegisterBenchmark("latency", latency)->Iterations(1)->UseRealTime();
  benchmark::RunSpecifiedBenchmarks();
}
