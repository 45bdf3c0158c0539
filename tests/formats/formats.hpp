// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "src/formats/dat/dat.hpp"
#include "src/formats/es/es.hpp"
#include "src/formats/evt/raw.hpp"

namespace formats {

using namespace eventcamera;

/// Format that can be read and written.
struct Format {
  std::string name;
  int max_side;
  Microseconds max_pause;  ///< maximum that it supports, or that tests have time for
  std::function<std::unique_ptr<EventDecoder>(SensorSize)> make_decoder;
  std::function<std::unique_ptr<Encoder>(SensorSize)> make_encoder;
};

inline void PrintTo(const Format& format, std::ostream* out) {
  *out << format.name;
}

inline constexpr Microseconds minutes = 60'000'000;

inline std::vector<Format> all() {
  std::vector<Format> formats;
  const std::pair<const char*, EvtFormat> words[] = {{"evt2", EvtFormat::evt2},
                                                     {"evt21", EvtFormat::evt21},
                                                     {"evt21_legacy", EvtFormat::evt21_legacy},
                                                     {"evt3", EvtFormat::evt3},
                                                     {"evt4", EvtFormat::evt4}};
  for (const auto& [name, format] : words) {
    const auto evt = format;
    const auto pause = evt == EvtFormat::evt3   ? 90 * minutes
                       : evt == EvtFormat::evt4 ? 10 * minutes
                                                : 700 * minutes;
    formats.push_back({name, 2048, pause,
                       [evt](SensorSize size) { return make_evt_decoder(evt, size); },
                       [evt](SensorSize size) { return make_evt_encoder(evt, size); }});
    formats.push_back({std::string("raw_") + name, 2048, pause,
                       [](SensorSize) { return make_prophesee_raw_decoder(); },
                       [evt](SensorSize size) { return make_prophesee_raw_encoder(evt, size); }});
  }
  formats.push_back({"dat", 16384, 35 * minutes, [](SensorSize) { return make_dat_decoder(); },
                     make_dat_encoder});
  formats.push_back({"es", 16384, 3 * minutes,
                     [](SensorSize) { return make_event_stream_decoder(); },
                     [](SensorSize size) { return make_event_stream_encoder(size); }});
  return formats;
}

}  // namespace formats
