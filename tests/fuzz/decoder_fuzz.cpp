// SPDX-License-Identifier: LGPL-2.1-or-later
// Decoders of a single stream of events; the environment variable FORMAT names one of them.
#include <cstdlib>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "src/formats/aedat/aedat3_decoder.hpp"
#include "src/formats/atis/atis_bin.hpp"
#include "src/formats/dat/dat.hpp"
#include "src/formats/es/es.hpp"
#include "src/formats/evt/raw.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/text/csv_decoder.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

namespace {

using namespace eventcamera;

struct Format {
  std::function<std::unique_ptr<EventDecoder>()> make_decoder;
  std::size_t events_per_byte = 1;  ///< at most
};

template <class Decoder>
Format of_class() {
  return {[] { return std::make_unique<Decoder>(); }};
}

Format of_words(EvtFormat format) {
  return {[format] { return make_evt_decoder(format, {640, 480}); }, 6};
}

const Format& format() {
  static const std::map<std::string, Format> formats = {
      {"aedat3", of_class<Aedat3Decoder>()},
      {"atis", {[] {
         return make_atis_bin_decoder({34, 34});
       }}},
      {"csv", of_class<CsvDecoder>()},
      {"dat", {[] { return make_dat_decoder(); }}},
      {"es", {[] { return make_event_stream_decoder(); }}},
      {"evt2", of_words(EvtFormat::evt2)},
      {"evt21", of_words(EvtFormat::evt21)},
      {"evt21_legacy", of_words(EvtFormat::evt21_legacy)},
      {"evt3", of_words(EvtFormat::evt3)},
      {"evt4", of_words(EvtFormat::evt4)},
      {"npy", of_class<NpyDecoder>()},
      {"raw", {[] { return make_prophesee_raw_decoder(); }, 6}},
  };
  static const Format& chosen = formats.at(std::getenv("FORMAT"));
  return chosen;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::decoder(format().make_decoder, data, size, format().events_per_byte);
}
