// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/evt/raw.hpp"

#include <stdexcept>
#include <string>
#include <utility>

#include "src/formats/evt/evt2.hpp"
#include "src/formats/evt/evt21.hpp"
#include "src/formats/evt/evt3.hpp"
#include "src/formats/evt/evt4.hpp"
#include "src/formats/text_header.hpp"
#include "src/formats/unit_decoder.hpp"

namespace eventcamera {
namespace {

/// Columns and rows are numbers of 11 bits.
constexpr int max_side = 2048;

std::unique_ptr<UnitReader> make_reader(EvtFormat format, SensorSize size) {
  switch (format) {
    case EvtFormat::evt2:
      return make_evt2_reader(size);
    case EvtFormat::evt21:
      return make_evt21_reader(Evt21Order::little, size);
    case EvtFormat::evt21_legacy:
      return make_evt21_reader(Evt21Order::legacy, size);
    case EvtFormat::evt3:
      return make_evt3_reader(size);
    case EvtFormat::evt4:
      return make_evt4_reader(size);
  }
  throw std::invalid_argument("no such format");
}

/// The value of "format", such as "EVT3;height=720;width=1280".
class FormatValue {
 public:
  explicit FormatValue(const std::string& value) : value_(value) {}

  std::string name() const { return value_.substr(0, value_.find(';')); }

  std::string option(const std::string& key) const {
    const auto found = value_.find(';' + key + '=');
    if (found == std::string::npos) return {};
    const auto first = found + key.size() + 2;
    return value_.substr(first, value_.find(';', first) - first);
  }

 private:
  std::string value_;
};

EvtFormat format_of(const TextHeader& header) {
  const FormatValue value(header.value("format"));
  const auto version = header.value("evt");
  auto name = value.name();
  // Headers from before "format", and of some other writers, tell only the version.
  if (name.empty() && version == "2.0") name = "EVT2";
  if (name.empty() && version == "2.1") name = "EVT21";
  if (name.empty() && version == "3.0") name = "EVT3";
  if (name.empty() && version == "4.0") name = "EVT4";
  if (name == "EVT2") return EvtFormat::evt2;
  if (name == "EVT3") return EvtFormat::evt3;
  if (name == "EVT4") return EvtFormat::evt4;
  if (name == "EVT21") {
    auto order = value.option("endianness");
    if (order.empty()) order = header.value("endianness");
    // Writers that know of two orders tell which it is. Before them there were only cameras with
    // the legacy one, and they tell their system.
    if (order.empty()) order = header.value("system_ID").empty() ? "little" : "legacy";
    if (order == "little") return EvtFormat::evt21;
    if (order == "legacy") return EvtFormat::evt21_legacy;
    throw UnsupportedFormat("EVT21 words in the byte order '" + order + "' cannot be read");
  }
  if (name.empty())
    throw UnsupportedFormat("the RAW header does not tell the format of the events");
  throw UnsupportedFormat("RAW files of the format '" + name + "' cannot be read");
}

SensorSize size_of(const TextHeader& header) {
  const FormatValue format(header.value("format"));
  SensorSize size{TextHeader::number(format.option("width"), max_side),
                  TextHeader::number(format.option("height"), max_side)};
  if (size.width == 0 || size.height == 0) {
    const auto geometry = header.value("geometry");
    const auto cross = geometry.find('x');
    if (cross != std::string::npos)
      size = {TextHeader::number(geometry.substr(0, cross), max_side),
              TextHeader::number(geometry.substr(cross + 1), max_side)};
  }
  // Files of the first cameras tell none; one that cannot be is none.
  if (size.width == 0 || size.height == 0) return {};
  return size;
}

class RawDecoder final : public UnitDecoder {
 private:
  std::size_t read_header(std::span<const std::uint8_t> bytes, bool ended) override {
    const auto taken = header_.take(bytes, ended);
    if (header_.ended()) {
      if (!header_.found())
        throw UnsupportedFormat("no RAW file of Prophesee: it does not begin with a header");
      const auto size = size_of(header_);
      begin(make_reader(format_of(header_), size), size);
    }
    return taken;
  }

  TextHeader header_;
};

/// Without the date of writing, so that the same events make the same file.
std::string header_text(EvtFormat format, SensorSize size) {
  const auto width = std::to_string(size.width);
  const auto height = std::to_string(size.height);
  std::string version;
  std::string name;
  switch (format) {
    case EvtFormat::evt2:
      version = "2.0";
      name = "EVT2";
      break;
    case EvtFormat::evt21:
      version = "2.1";
      name = "EVT21;endianness=little";
      break;
    case EvtFormat::evt21_legacy:
      version = "2.1";
      name = "EVT21;endianness=legacy";
      break;
    case EvtFormat::evt3:
      version = "3.0";
      name = "EVT3";
      break;
    case EvtFormat::evt4:
      version = "4.0";
      name = "EVT4";
      break;
  }
  // OpenEB looks for the plugin that reads the file by the integrators, and other readers only at
  // "evt", or "geometry".
  return "% camera_integrator_name Prophesee\n% evt " + version + "\n% format " + name +
         ";height=" + height + ";width=" + width + "\n% geometry " + width + "x" + height +
         "\n% plugin_integrator_name Prophesee\n% end\n";
}

class RawEncoder final : public Encoder {
 public:
  RawEncoder(EvtFormat format, SensorSize size)
      : header_(header_text(format, size)), words_(make_evt_encoder(format, size)) {}

  void encode(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    write_header(out);
    words_->encode(events, out);
  }

  void finish(std::vector<std::uint8_t>& out) override {
    write_header(out);
    words_->finish(out);
  }

 private:
  void write_header(std::vector<std::uint8_t>& out) {
    out.insert(out.end(), header_.begin(), header_.end());
    header_.clear();
  }

  std::string header_;  // empty once it is written
  std::unique_ptr<Encoder> words_;
};

}  // namespace

std::unique_ptr<Decoder> make_prophesee_raw_decoder() {
  return std::make_unique<RawDecoder>();
}

std::unique_ptr<Encoder> make_prophesee_raw_encoder(EvtFormat format, SensorSize size) {
  return std::make_unique<RawEncoder>(format, size);
}

std::unique_ptr<Decoder> make_evt_decoder(EvtFormat format, SensorSize size) {
  return std::make_unique<UnitDecoder>(make_reader(format, size), size);
}

std::unique_ptr<Encoder> make_evt_encoder(EvtFormat format, SensorSize size) {
  if (size.width < 1 || size.height < 1 || size.width > max_side || size.height > max_side)
    throw std::invalid_argument("EVT words are for sensors of 1x1 to 2048x2048 pixels");
  switch (format) {
    case EvtFormat::evt2:
      return make_evt2_encoder();
    case EvtFormat::evt21:
      return make_evt21_encoder(Evt21Order::little);
    case EvtFormat::evt21_legacy:
      return make_evt21_encoder(Evt21Order::legacy);
    case EvtFormat::evt3:
      return make_evt3_encoder(size);
    case EvtFormat::evt4:
      return make_evt4_encoder();
  }
  throw std::invalid_argument("no such format");
}

}  // namespace eventcamera
