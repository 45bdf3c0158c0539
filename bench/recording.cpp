// SPDX-License-Identifier: LGPL-2.1-or-later
// Times filesrc ! evtdec ! fakesink against the decoder alone, in turns on one file, and prints the
// ratio of their processor times: recording_bench [MILLION EVENTS], by default 100.
#include <gst/gst.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>
#include <vector>

#include "src/formats/evt/raw.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;

constexpr SensorSize size{1280, 720};
constexpr std::size_t piece_size = std::size_t{1} << 18;
constexpr int turns = 5;

/// Writes a RAW file of EVT3 words: single events and runs, 10 million a second.
void write_recording(const std::string& path, std::size_t count) {
  recordings::Random random(1);
  const auto encoder = make_prophesee_raw_encoder(EvtFormat::evt3, size);
  std::ofstream file(path, std::ios::binary);
  std::vector<AbsoluteEvent> events;
  std::vector<std::uint8_t> bytes;
  Microseconds t = 0;
  for (std::size_t written = 0; written < count; written += events.size(), t += 1000) {
    events.clear();
    while (events.size() < 10'000) {
      const auto time = t + static_cast<Microseconds>(events.size() / 10);
      const int y = recordings::below(random, size.height);
      const int first = recordings::below(random, size.width);
      const int end = std::min(size.width, first + 1 + recordings::below(random, 4));
      for (int x = first; x < end; ++x)
        events.push_back(AbsoluteEvent::at(x, y, time, Polarity::on));
    }
    bytes.clear();
    encoder->encode(events, bytes);
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }
  bytes.clear();
  encoder->finish(bytes);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

/// Returns the number of events.
std::size_t decode(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const auto decoder = make_prophesee_raw_decoder();
  std::vector<std::uint8_t> piece(piece_size);
  Decoded decoded;
  std::size_t events = 0;
  while (file.read(reinterpret_cast<char*>(piece.data()), piece_size) || file.gcount() > 0) {
    decoder->decode(std::span(piece).first(static_cast<std::size_t>(file.gcount())), decoded);
    events += decoded.events.size();
    decoded.events.clear();
  }
  decoder->finish(decoded);
  return events + decoded.events.size();
}

void play(const std::string& path) {
  const std::string line = "filesrc location=\"" + path + "\" ! evtdec ! fakesink";
  GstElement* pipeline = gst_parse_launch(line.c_str(), nullptr);
  GstBus* bus = gst_element_get_bus(pipeline);
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  GstMessage* end = gst_bus_timed_pop_filtered(
      bus, GST_CLOCK_TIME_NONE, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  if (GST_MESSAGE_TYPE(end) != GST_MESSAGE_EOS) std::exit(1);
  gst_message_unref(end);
  gst_object_unref(bus);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(pipeline);
}

/// Processor time of all threads, seconds.
template <class Work>
double cost_of(const Work& work) {
  const auto before = std::clock();
  work();
  return static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
}

}  // namespace

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  const auto millions = argc > 1 ? std::atof(argv[1]) : 100;
  gchar* directory = g_dir_make_tmp("recording-bench-XXXXXX", nullptr);
  const std::string path = std::string(directory) + "/events.raw";
  write_recording(path, static_cast<std::size_t>(millions * 1e6));
  std::size_t events = decode(path);  // the file is in memory now
  play(path);                         // and the plugin loaded
  std::vector<double> ratios;
  for (int i = 0; i < turns; ++i) {
    const auto decoder = cost_of([&] { events = decode(path); });
    const auto element = cost_of([&] { play(path); });
    ratios.push_back(element / decoder);
    std::printf("%zu events: decoder %.2f s, filesrc ! evtdec ! fakesink %.2f s, ratio %.2f\n",
                events, decoder, element, ratios.back());
  }
  std::ranges::sort(ratios);
  std::printf("median ratio %.2f\n", ratios[turns / 2]);
  std::remove(path.c_str());
  std::remove(directory);
  g_free(directory);
}
