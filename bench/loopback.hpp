// SPDX-License-Identifier: LGPL-2.1-or-later
// Events through sockets of this machine.
#pragma once

#include <benchmark/benchmark.h>
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>

#include <chrono>
#include <ctime>
#include <string>
#include <thread>
#include <vector>

#include "src/formats/evt/raw.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/formats/shared_data.hpp"

namespace bench {

using namespace eventcamera;
using Clock = std::chrono::steady_clock;

struct Recording {
  std::string name;
  SensorSize size;
  std::vector<AbsoluteEvent> events;
};

/// Recording of a real camera; without events if the file is missing.
inline Recording recorded(const std::string& name, const std::string& file) {
  const auto bytes = shared_data::events_file(file);
  if (bytes.empty()) return {name, {}, {}};
  const auto decoder = make_prophesee_raw_decoder();
  auto decoded = recordings::decode(*decoder, bytes);
  return {name, decoder->size(), std::move(decoded.events)};
}

/// Random pixels, 10 million per second.
inline Recording noise() {
  recordings::Random random(1);
  Recording recording{"noise", {640, 480}, {}};
  for (int i = 0; i < 1 << 18; ++i)
    recording.events.push_back(
        AbsoluteEvent::at(recordings::below(random, 640), recordings::below(random, 480), i / 10,
                          recordings::below(random, 2) == 0 ? Polarity::off : Polarity::on));
  return recording;
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

/// Buffer of a millisecond of events.
inline GstBuffer* millisecond(const std::vector<Event>& events, int number) {
  GstBuffer* const buffer =
      gst_buffer_new_memdup(events.data(), events.size() * sizeof events.front());
  GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(number) * GST_MSECOND;
  GST_BUFFER_DURATION(buffer) = GST_MSECOND;
  return buffer;
}

/// Sends for a second, and returns the seconds that it took. Calls pushed(i) before millisecond i.
template <class Pushed>
double send(GstAppSrc* source, std::size_t events_per_ms, const Pushed& pushed) {
  recordings::Random random(1);
  std::vector<Event> events;
  for (std::size_t i = 0; i < events_per_ms; ++i)
    events.push_back(Event::at(recordings::below(random, 640), recordings::below(random, 480),
                               static_cast<std::uint32_t>(i * 1000 / events_per_ms), Polarity::on));
  const auto start = Clock::now();
  for (int i = 0; i < 1000; ++i) {
    std::this_thread::sleep_until(start + std::chrono::milliseconds(i));
    pushed(i);
    gst_app_src_push_buffer(source, millisecond(events, i));
  }
  gst_app_src_end_of_stream(source);
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Receiver with a free port; `from` is what follows udpsrc, with the depayloader "depay".
inline Pipeline receive(const std::string& from) {
  return {"udpsrc name=source address=127.0.0.1 port=0 buffer-size=4194304 " + from +
              " ! fakesink sync=false async=false",
          "depay"};
}

/// Sender of events of 640x480 pixels through `payloader`.
inline Pipeline send_to(const Pipeline& receiver, const std::string& payloader) {
  int port = 0;
  g_object_get(receiver.named("source"), "port", &port, nullptr);
  return {
      "appsrc name=source format=time block=true max-bytes=400000 "
      "caps=application/x-event-camera,format=XYTP,width=640,height=480,framerate=0/1 ! " +
          payloader +
          " name=pay ! udpsink sync=false async=false host=127.0.0.1 port=" + std::to_string(port),
      "pay"};
}

/// Sends and receives for a second; counts what was sent, what did not arrive, and processors in
/// use.
inline void loopback(benchmark::State& state, std::size_t events_per_ms, const std::string& from,
                     const std::string& payloader) {
  const auto receiver = receive(from);
  const auto sender = send_to(receiver, payloader);
  for (auto _ : state) {
    const auto cpu = std::clock();
    const double seconds = send(GST_APP_SRC(sender.named("source")), events_per_ms, [](int) {});
    const auto sent = static_cast<double>(1000 * events_per_ms);
    state.counters["offered"] = static_cast<double>(events_per_ms) / 1e3;
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

/// Registers a run of loopback().
inline void register_loopback(const std::string& name, std::size_t events_per_ms,
                              const std::string& from, const std::string& payloader) {
  benchmark::RegisterBenchmark(
      name.c_str(), [=](auto& state) { loopback(state, events_per_ms, from, payloader); })
      ->Iterations(1)
      ->UseRealTime();
}

/// Registers growth/rate/NAME/RATE for growing rates, in million events per second.
inline void register_growth(const std::string& name, const std::string& from,
                            const std::string& payloader) {
  for (const int rate : {1, 2, 5, 10, 20, 40})
    register_loopback("growth/rate/" + name + "/" + std::to_string(rate),
                      static_cast<std::size_t>(rate) * 1000, from, payloader);
}

}  // namespace bench
