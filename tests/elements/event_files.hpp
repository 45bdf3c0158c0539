// SPDX-License-Identifier: LGPL-2.1-or-later
// Event files of every format that has one stream, and the elements that write and read them.
#pragma once

#include <algorithm>
#include <ostream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tests/elements/pipeline.hpp"

namespace event_files {

using namespace eventcamera;
using harness::Harness;
using harness::Owned;
using Events = std::vector<AbsoluteEvent>;

inline constexpr int width = 320;
inline constexpr int height = 240;
inline const std::string events_caps =
    "application/x-event-camera, format=XYTP, width=320, height=240, framerate=0/1";

struct Format {
  std::string name;
  std::string writer;
  std::string reader;
  std::string caps;
  std::string end = {};     ///< invalid bytes at the end; by default the file is truncated
  bool tells_size = true;   ///< the file states the sensor size
  bool is_archive = false;  ///< written and read at the end of the stream
};

inline void PrintTo(const Format& format, std::ostream* out) {
  *out << format.name;
}

inline const Format formats[] = {
    {"evt2", "evtenc format=EVT2", "evtdec", "application/x-prophesee-raw"},
    {"evt21", "evtenc format=EVT21", "evtdec", "application/x-prophesee-raw"},
    {"evt3", "evtenc format=EVT3", "evtdec", "application/x-prophesee-raw"},
    {"evt4", "evtenc format=EVT4", "evtdec", "application/x-prophesee-raw"},
    {"dat", "eventdatenc", "eventdatdec", "application/x-prophesee-dat"},
    {"es", "eventesenc", "eventesdec", "application/x-es"},
    {"csv", "eventcsvenc format=metavision", "eventcsvdec", "application/x-event-csv", "no\n"},
    {"npy", "eventnpyenc", "eventnpydec", "application/x-npy", "", false},
    {"npz", "eventnpzenc", "eventnpzdec", "application/x-npz", "", true, true},
};

/// Formats whose files are read up to where they are truncated.
inline std::vector<Format> stream_formats() {
  std::vector<Format> streams(std::begin(formats), std::end(formats));
  std::erase_if(streams, [](const Format& format) { return format.is_archive; });
  return streams;
}

inline const Format& format_of(std::string_view name) {
  return *std::ranges::find(formats, name, &Format::name);
}

/// Instantiated in file_reading_test.cpp.
class EveryFormat : public testing::TestWithParam<Format> {
 protected:
  const Format& format() const { return GetParam(); }
};

inline std::string name_of(const testing::TestParamInfo<Format>& test) {
  return test.param.name;
}

/// Sorted events without duplicates: a dot that runs through the rows for a second, from 2 s on,
/// and again after a silence of three seconds.
inline Events some_events() {
  Events events;
  for (int i = 0; i < 20'000; ++i) {
    const Microseconds t = 2'000'000 + 50 * i + (i >= 10'000 ? 3'000'000 : 0);
    events.push_back(
        AbsoluteEvent::at(i % width, i / width, t, i % 3 == 0 ? Polarity::off : Polarity::on));
  }
  return events;
}

/// An element that writes a file, or words without a header.
struct Writer : Harness {
  Writer(const std::string& launch, const std::string& file_caps) : Harness(launch) {
    gst_harness_set_sink_caps_str(get(), file_caps.c_str());
    gst_harness_set_src_caps_str(get(), events_caps.c_str());
  }
  explicit Writer(const Format& format) : Writer(format.writer, format.caps) {}

  void write(std::span<const AbsoluteEvent> events, Microseconds start) {
    EXPECT_EQ(push(buffer_of(events, start)), GST_FLOW_OK);
  }
  void write(const AbsoluteEvent& event, Microseconds start) { write(std::span(&event, 1), start); }

  std::string pull_bytes() {
    std::string bytes;
    while (const auto buffer = pull()) bytes += harness::bytes_of(buffer.get());
    return bytes;
  }
  /// The next warning of dropped events, or empty.
  std::string dropped() {
    auto text = warning();
    while (!text.empty() && !text.starts_with("Dropped ")) text = warning();
    return text;
  }

  std::string end() {
    EXPECT_TRUE(gst_harness_push_event(get(), gst_event_new_eos()));
    return pull_bytes();
  }
};

/// An element that reads a file, or words without a header.
struct Reader : Harness {
  Reader(const std::string& launch, const std::string& file_caps)
      : Harness(with_late_pad(launch), launch) {
    gst_harness_set_src_caps_str(get(), file_caps.c_str());
  }
  explicit Reader(const Format& format, const std::string& properties = "")
      : Reader(format.reader + properties, format.caps) {
    harness::push_segment(get(), {.format = GST_FORMAT_BYTES});
  }

  void push_bytes(std::string_view bytes) {
    push(gst_buffer_new_memdup(bytes.data(), bytes.size()));
  }
  /// The whole file, in pieces.
  void read(std::string_view file, std::size_t piece = 1000) {
    for (std::size_t at = 0; at < file.size(); at += piece) push_bytes(file.substr(at, piece));
    gst_harness_push_event(get(), gst_event_new_eos());
  }
};

/// File with these events, written by the element.
inline std::string file_of(const Format& format, std::span<const AbsoluteEvent> events) {
  Writer writer(format);
  push_events(writer, events);
  return writer.end();
}

inline Events events_in(const Format& format, std::string_view file) {
  Reader reader(format);
  reader.read(file);
  return pull_events(reader);
}

}  // namespace event_files
