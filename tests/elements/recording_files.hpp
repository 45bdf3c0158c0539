// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <span>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "src/formats/evt/raw.hpp"
#include "tests/elements/pipeline.hpp"
#include "tests/formats/aedat_files.hpp"

/// A recording of five seconds, in files of every format.
namespace recording_files {

using namespace eventcamera;
using harness::Owned;
using Bytes = std::vector<std::uint8_t>;

inline constexpr SensorSize sensor{346, 260};
inline constexpr Microseconds length = 5'000'000;
/// File times differ from the player's times.
inline constexpr Microseconds beginning = 30'000'000;

/// A dot that runs through the rows.
inline std::vector<AbsoluteEvent> some_events() {
  std::vector<AbsoluteEvent> events;
  constexpr Microseconds step = 100;
  for (Microseconds t = 0; t < length; t += step) {
    const auto i = static_cast<int>(t / step);
    events.push_back(AbsoluteEvent::at(i % sensor.width, i / 7 % sensor.height, beginning + t,
                                       i % 3 == 0 ? Polarity::on : Polarity::off));
  }
  return events;
}

/// Launch lines of the elements that read or write files, by extension, as GStreamer's registry
/// knows them.
inline std::map<std::string, std::string> elements_with(const char* extensions) {
  gst_init(nullptr, nullptr);
  std::map<std::string, std::string> elements;
  GList* const features =
      gst_registry_get_feature_list(gst_registry_get(), GST_TYPE_ELEMENT_FACTORY);
  for (const GList* item = features; item != nullptr; item = item->next) {
    auto* const factory = GST_ELEMENT_FACTORY(item->data);
    const char* const text = gst_element_factory_get_metadata(factory, extensions);
    std::string entries = text != nullptr ? text : "";
    std::ranges::replace(entries, ',', ';');
    std::istringstream stream(entries);
    for (std::string entry; std::getline(stream >> std::ws, entry, ';');) {
      const auto end = std::min(entry.find(' '), entry.size());
      elements[entry.substr(0, end)] = GST_OBJECT_NAME(factory) + entry.substr(end);
    }
  }
  gst_plugin_feature_list_free(features);
  return elements;
}

/// The files, in a folder that lasts as long as the tests.
class Folder {
 public:
  static std::string path(const std::string& name) {
    static const Folder folder;
    auto path = folder.path_ / name;
    if ((name == "ros1.bag" || name == "ros2.db3") && !std::filesystem::exists(path))
      folder.save_bags();
    return path;
  }

 private:
  Folder() {
    gst_init(nullptr, nullptr);
    const auto events = some_events();
    for (const auto& [name, format] : {std::pair{"evt2.raw", EvtFormat::evt2},
                                       {"evt21.raw", EvtFormat::evt21},
                                       {"evt3.raw", EvtFormat::evt3},
                                       {"evt4.raw", EvtFormat::evt4}}) {
      Bytes bytes;
      const auto encoder = eventcamera::make_prophesee_raw_encoder(format, sensor);
      encoder->encode(events, bytes);
      encoder->finish(bytes);
      save(name, bytes);
    }
    save("aedat2.aedat", eventcamera::aedat_files::aedat2_davis(events, sensor, "DAVIS346"));
    save("aedat3.aedat", eventcamera::aedat_files::aedat3(events, "DAVIS346", 4096));
    save("atis.bin", atis_bin(events));
    for (const auto& [extension, writer] : elements_with("output-extensions")) {
      Pipeline pipeline("filesrc location=" + in_quotes(path_ / "evt3.raw") + " ! evtdec ! " +
                        writer + (writer.starts_with("eventhdf5sink") ? "" : " ! filesink") +
                        " location=" + in_quotes(path_ / ("a." + extension)));
      EXPECT_TRUE(pipeline.play()) << pipeline.error;
    }
  }

  /// By the writer of tests/formats, which takes seconds under load: only if a test needs them.
  void save_bags() const {
    std::ofstream lines(path_ / "events.lines");
    for (const auto& event : some_events())
      lines << event.t << ' ' << event.x << ' ' << event.y() << ' '
            << (event.polarity() == Polarity::on) << '\n';
    lines.close();
    const auto script = std::string(g_getenv("SOURCE")) + "/tests/formats/bag_files.py";
    const auto command = "/usr/bin/python3 " + in_quotes(script) + ' ' + in_quotes(path_ / "") +
                         " given " + in_quotes(path_ / "events.lines");
    EXPECT_EQ(std::system(command.c_str()), 0);
  }

  /// Those of 240 columns and rows; others do not fit.
  static Bytes atis_bin(std::span<const AbsoluteEvent> events) {
    Bytes bytes;
    for (const auto& event : events) {
      if (event.x >= 240 || event.y() >= 240) continue;
      const auto t = event.t - beginning;
      const int polarity = event.polarity() == Polarity::on ? 0x80 : 0;
      bytes.insert(bytes.end(),
                   {static_cast<std::uint8_t>(event.x), static_cast<std::uint8_t>(event.y()),
                    static_cast<std::uint8_t>(t >> 16 | polarity),
                    static_cast<std::uint8_t>(t >> 8), static_cast<std::uint8_t>(t)});
    }
    return bytes;
  }

  void save(const std::string& name, const Bytes& bytes) const {
    std::ofstream(path_ / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }

  TemporaryFolder path_;
};

struct File {
  std::string name;
  std::string reader;

  std::string path() const { return Folder::path(name); }
};

inline const std::vector<File>& files() {
  static const auto files = [] {
    std::vector<File> made = {{"evt2.raw", "evtdec"},         {"evt21.raw", "evtdec"},
                              {"evt4.raw", "evtdec"},         {"aedat2.aedat", "aedatdemux"},
                              {"aedat3.aedat", "aedatdemux"}, {"ros1.bag", "eventbagdemux"},
                              {"ros2.db3", "eventbagdemux"}};
    auto readers = elements_with("input-extensions");
    for (const auto& [extension, writer] : elements_with("output-extensions"))
      made.push_back({"a." + extension, readers.at(extension)});
    return made;
  }();
  return files;
}

/// Part of a test's name.
inline std::string test_name(std::string text) {
  for (auto& c : text)
    if (g_ascii_isalnum(c) == FALSE) c = '_';
  return text;
}

}  // namespace recording_files
