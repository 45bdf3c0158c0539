// SPDX-License-Identifier: LGPL-2.1-or-later
// Every format of datagrams, and the datagrams of a stream.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "src/wire/datagrams.hpp"

namespace eventcamera::datagrams {

using Bytes = std::vector<std::uint8_t>;

/// A format with its nick, as properties of the elements have it.
struct Variant {
  std::string name;
  DatagramSettings settings;
};

/// All formats, for a sensor that each supports.
inline std::vector<Variant> all(int width = 640, int height = 480) {
  using enum DatagramFormat;
  std::vector<Variant> variants = {
      {"spif", {.format = spif}},
      {"spif-big-endian", {.format = spif, .byte_order = std::endian::big}},
      {"spif-timestamps", {.format = spif_timestamps}},
      {"spif-timestamps-big-endian", {.format = spif_timestamps, .byte_order = std::endian::big}},
      {"t64-x16-y16-on8", {.format = t64_x16_y16_on8}},
      {"t32-x16-y15-on1", {.format = t32_x16_y15_on1}},
      {"es", {.format = es}},
      {"jaer", {.format = jaer}},
      {"jaer-without-sequence-number", {.format = jaer, .has_sequence_number = false}}};
  for (auto& variant : variants) {
    variant.settings.width = width;
    variant.settings.height = height;
  }
  return variants;
}

struct Packet {
  Bytes bytes;
  std::size_t events;
  Microseconds first;
  Microseconds last;
};

inline std::vector<Packet> packets_of(DatagramPacker& packer,
                                      std::span<const AbsoluteEvent> events) {
  std::vector<Packet> packets;
  const auto keep = [&](const Datagram& datagram) {
    packets.push_back({{datagram.bytes.begin(), datagram.bytes.end()},
                       datagram.events,
                       datagram.first,
                       datagram.last});
  };
  packer.pack(events, keep);
  packer.flush(keep);
  return packets;
}

inline std::vector<Packet> packets_of(const DatagramSettings& settings,
                                      std::span<const AbsoluteEvent> events) {
  const auto packer = make_datagram_packer(settings);
  packer->set_max_span(5000);
  return packets_of(*packer, events);
}

}  // namespace eventcamera::datagrams
