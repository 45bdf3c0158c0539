// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/evt/raw.hpp"

#include <algorithm>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

#include "src/formats/evt/words.hpp"
#include "src/formats/prophesee_header.hpp"
#include "src/formats/unit_stream_decoder.hpp"

namespace eventcamera {
namespace {

struct Name {
  EvtFormat format;
  std::string_view version;
  const char* name;
  std::string_view options;
};

constexpr Name names[] = {
    {EvtFormat::evt2, "2.0", "EVT2", ""},
    {EvtFormat::evt21, "2.1", "EVT21", ";endianness=little"},
    {EvtFormat::evt21_legacy, "2.1", "EVT21", ";endianness=legacy"},
    {EvtFormat::evt3, "3.0", "EVT3", ""},
    {EvtFormat::evt4, "4.0", "EVT4", ""},
};

/// Returns an option in the value of "format", such as the height in "EVT3;height=720;width=1280".
std::string option(const std::string& format, const std::string& key) {
  const auto found = format.find(';' + key + '=');
  if (found == std::string::npos) return {};
  const auto first = found + key.size() + 2;
  return format.substr(first, format.find(';', first) - first);
}

/// Size of the sensor of a camera of Prophesee, by the numbers of its systems in OpenEB, and by the
/// names of its plugin, sensor or generation; 0x0 if unknown.
SensorSize size_of_camera(const PropheseeHeader& header) {
  struct Camera {
    SensorSize size;
    std::initializer_list<std::string_view> names;
    std::initializer_list<std::string_view> systems;
  };
  const Camera cameras[] = {
      {{320, 320}, {"genx320", "saphir"}, {"55", "59", "64"}},
      {{640, 512}, {"imx637", "imx647"}, {"52", "54"}},
      {{640, 480}, {"gen3", "3.0", "3.1"}, {"25", "29", "33", "34", "35", "40", "41"}},
      {{1280, 720},
       {"gen4", "imx636", "imx646", "4.0", "4.1", "4.2"},
       {"30", "31", "32", "39", "46", "48", "49", "50", "53", "58", "66"}}};
  for (const auto* const key : {"plugin_name", "sensor_name", "sensor_generation"}) {
    auto text = header.value(key);
    std::ranges::transform(text, text.begin(), [](char letter) {
      return letter >= 'A' && letter <= 'Z' ? static_cast<char>(letter | 0x20) : letter;
    });
    for (const auto& camera : cameras)
      for (const auto name : camera.names)
        if (text.find(name) != std::string::npos) return camera.size;
  }
  for (const auto& camera : cameras)
    if (std::ranges::count(camera.systems, header.value("system_ID")) > 0) return camera.size;
  return {};
}

/// 0x0 if it is neither stated, as in files of the first cameras, nor known of the camera.
SensorSize size_of(const PropheseeHeader& header) {
  const auto size_from = [](const std::string& width, const std::string& height) {
    const SensorSize size{PropheseeHeader::number(width, max_evt_side),
                          PropheseeHeader::number(height, max_evt_side)};
    return size.width == 0 || size.height == 0 ? SensorSize{} : size;
  };
  const auto format = header.value("format");
  const auto size = size_from(option(format, "width"), option(format, "height"));
  const auto geometry = header.value("geometry");
  const auto cross = geometry.find('x');
  if (size != SensorSize{}) return size;
  if (cross == std::string::npos) return size_of_camera(header);
  return size_from(geometry.substr(0, cross), geometry.substr(cross + 1));
}

EvtFormat format_of(const PropheseeHeader& header) {
  const auto format = header.value("format");
  const auto name = format.substr(0, format.find(';'));
  // Older headers, and headers of some other writers, have only the version.
  const auto* const known = name.empty()
                                ? std::ranges::find(names, header.value("evt"), &Name::version)
                                : std::ranges::find(names, name, &Name::name);
  if (known == std::end(names))
    throw UnsupportedFormat(name.empty() ? "no event format in the RAW header"
                                         : "unsupported RAW format '" + name + "'");
  if (known->format != EvtFormat::evt21) return known->format;
  auto order = option(format, "endianness");
  if (order.empty()) order = header.value("endianness");
  // Writers that know both orders state theirs. Older files are from cameras with the legacy order,
  // which state their system. The order of GenX320 is always little.
  const bool is_legacy =
      !header.value("system_ID").empty() && size_of(header) != SensorSize{320, 320};
  if (order.empty()) order = is_legacy ? "legacy" : "little";
  if (order == "little") return EvtFormat::evt21;
  if (order == "legacy") return EvtFormat::evt21_legacy;
  throw UnsupportedFormat("unsupported byte order '" + order + "' of EVT21 words");
}

class RawDecoder final : public UnitStreamDecoder {
 private:
  std::size_t read_header(std::span<const std::uint8_t> bytes, bool ended) override {
    const auto length = header_.read_line(bytes, ended);
    if (header_.ended()) {
      if (!header_.found()) throw UnsupportedFormat("not a Prophesee RAW file: no header");
      const auto size = size_of(header_);
      begin(make_evt_unit_decoder(format_of(header_), size), size);
    }
    return length;
  }

  PropheseeHeader header_;
};

/// Does not include the date, so that the same events give the same file.
std::string header_text(EvtFormat format, SensorSize size) {
  const auto width = std::to_string(size.width);
  const auto height = std::to_string(size.height);
  const auto& written = *std::ranges::find(names, format, &Name::format);
  // OpenEB selects its plugin by the integrators; other readers only look at "evt" or "geometry".
  return "% camera_integrator_name Prophesee\n% evt " + std::string(written.version) +
         "\n% format " + written.name + std::string(written.options) + ";height=" + height +
         ";width=" + width + "\n% geometry " + width + "x" + height +
         "\n% plugin_integrator_name Prophesee\n% end\n";
}

}  // namespace

const char* evt_format_name(EvtFormat format) {
  return std::ranges::find(names, format, &Name::format)->name;
}

std::optional<EvtFormat> evt_format_named(std::string_view name) {
  const auto* const known = std::ranges::find(names, name, &Name::name);
  return known != std::end(names) ? std::optional(known->format) : std::nullopt;
}

std::unique_ptr<EventDecoder> make_prophesee_raw_decoder() {
  return std::make_unique<RawDecoder>();
}

std::unique_ptr<Encoder> make_prophesee_raw_encoder(EvtFormat format, SensorSize size) {
  return make_evt_encoder(format, size, header_text(format, size));
}

std::unique_ptr<EventDecoder> make_evt_decoder(EvtFormat format, SensorSize size) {
  return std::make_unique<UnitStreamDecoder>(make_evt_unit_decoder(format, size), size);
}

std::unique_ptr<Encoder> make_evt_encoder(EvtFormat format, SensorSize size) {
  return make_evt_encoder(format, size, std::string());
}

}  // namespace eventcamera
