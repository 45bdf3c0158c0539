// SPDX-License-Identifier: LGPL-2.1-or-later
// Datagrams of other tools.
//   RECORDING/FORMAT/pack, unpack   million events per second on one core, and bytes per event
//   loopback/FORMAT                 10 million events per second through sockets of this machine:
//                                   million events per second that were sent, percent that did not
//                                   arrive, and processors in use
//   meson devenv -C build-bench bench/datagrams_bench
#include <benchmark/benchmark.h>
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>

#include <chrono>
#include <cstdio>
#include <ctime>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "bench/codec_timing.hpp"
#include "src/formats/evt/raw.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/formats/shared_data.hpp"
#include "tests/wire/datagrams.hpp"

namespace {

using namespace eventcamera;
using Clock = std::chrono::steady_clock;

struct Recording {
  std::string name;
  SensorSize size;
  std::vector<AbsoluteEvent> events;
};

/// Recording of a real camera; without events if the file is missing.
Recording recorded(const std::string& name, const std::string& file) {
  const auto bytes = shared_data::events_file(file);
  if (bytes.empty()) return {name, {}, {}};
  const auto decoder = make_prophesee_raw_decoder();
  auto decoded = recordings::decode(*decoder, bytes);
  return {name, decoder->size(), std::move(decoded.events)};
}

/// Random pixels, 10 million per second.
Recording noise() {
  recordings::Random random(1);
  Recording recording{"noise", {640, 480}, {}};
  for (int i = 0; i < 1 << 18; ++i)
    recording.events.push_back(
        AbsoluteEvent::at(recordings::below(random, 640), recordings::below(random, 480), i / 10,
                          recordings::below(random, 2) == 0 ? Polarity::off : Polarity::on));
  return recording;
}

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

/// A pipeline, and one of its elements.
class Pipeline {
 public:
  Pipeline(const std::string& launch, const char* element)
      : pipeline_(gst_parse_launch(launch.c_str(), nullptr)),
        element_(gst_bin_get_by_name(GST_BIN(pipeline_), element)) {
    gst_element_set_state(pipeline_, GST_STATE_PLAYING);
    gst_element_get_state(pipeline_, nullptr, nullptr, GST_SECOND);
  }
  ~Pipeline() {
    gst_element_set_state(pipeline_, GST_STATE_NULL);
    gst_object_unref(element_);
    gst_object_unref(pipeline_);
  }
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  GstElement* named(const char* name) const {
    GstElement* const element = gst_bin_get_by_name(GST_BIN(pipeline_), name);
    gst_object_unref(element);  // the pipeline holds it
    return element;
  }

  guint64 events() const {
    GstStructure* stats = nullptr;
    g_object_get(element_, "stats", &stats, nullptr);
    guint64 events = 0;
    gst_structure_get_uint64(stats, "events", &events);
    gst_structure_free(stats);
    return events;
  }

 private:
  GstElement* pipeline_;
  GstElement* element_;
};

constexpr std::size_t events_per_ms = 10'000;

/// Buffer of a millisecond of events.
GstBuffer* millisecond(const std::vector<Event>& events, int number) {
  GstBuffer* const buffer =
      gst_buffer_new_memdup(events.data(), events.size() * sizeof events.front());
  GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(number) * GST_MSECOND;
  GST_BUFFER_DURATION(buffer) = GST_MSECOND;
  return buffer;
}

/// Sends for a second, and returns the seconds that it took.
double send(GstAppSrc* source) {
  recordings::Random random(1);
  std::vector<Event> events;
  for (std::size_t i = 0; i < events_per_ms; ++i)
    events.push_back(Event::at(recordings::below(random, 640), recordings::below(random, 480),
                               static_cast<std::uint32_t>(i / 10), Polarity::on));
  const auto start = Clock::now();
  for (int i = 0; i < 1000; ++i) {
    std::this_thread::sleep_until(start + std::chrono::milliseconds(i));
    gst_app_src_push_buffer(source, millisecond(events, i));
  }
  gst_app_src_end_of_stream(source);
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void loopback(benchmark::State& state, const std::string& format) {
  const Pipeline receiver(
      "udpsrc name=source address=127.0.0.1 port=0 buffer-size=4194304 ! "
      "eventdatagramdepay name=depay width=640 height=480 format=" +
          format + " ! fakesink sync=false async=false",
      "depay");
  int port = 0;
  g_object_get(receiver.named("source"), "port", &port, nullptr);
  const Pipeline sender(
      "appsrc name=source format=time block=true max-bytes=400000 "
      "caps=application/x-event-camera,format=XYTP,width=640,height=480,framerate=0/1 ! "
      "eventdatagrampay name=pay format=" +
          format + " ! udpsink sync=false async=false host=127.0.0.1 port=" + std::to_string(port),
      "pay");
  for (auto _ : state) {
    const auto cpu = std::clock();
    const double seconds = send(GST_APP_SRC(sender.named("source")));
    const auto sent = static_cast<double>(1000 * events_per_ms);
    state.counters["Mevents/s"] = sent / seconds / 1e6;
    guint64 received = 0;
    for (guint64 before = 1; received != before && received < 1000 * events_per_ms;) {
      before = received;
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
      received = receiver.events();
    }
    state.counters["lost%"] = 100 * (1 - static_cast<double>(received) / sent);
    state.counters["processors"] =
        static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC / seconds;
  }
}

}  // namespace

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  benchmark::Initialize(&argc, argv);
  const std::vector scenes{noise(), recorded("1280x720", "evt3-1280x720-triggers.raw"),
                           recorded("640x480", "evt3-640x480-triggers.raw")};
  for (const auto& scene : scenes) register_codecs(scene);
  for (const auto& format : formats_for({640, 480}))
    benchmark::RegisterBenchmark(("loopback/" + format.name).c_str(),
                                 [name = format.name](auto& state) { loopback(state, name); })
        ->Iterations(1)
        ->UseRealTime();
  benchmark::RunSpecifiedBenchmarks();
}
