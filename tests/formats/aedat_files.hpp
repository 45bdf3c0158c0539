// SPDX-License-Identifier: LGPL-2.1-or-later
// Hand-made AEDAT files for tests, independent of the tested code.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera::aedat_files {

using Bytes = std::vector<std::uint8_t>;

inline void add(Bytes& bytes, std::string_view text) {
  for (const char c : text) bytes.push_back(static_cast<std::uint8_t>(c));
}

inline void add(Bytes& bytes, const Bytes& more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

/// Appends the lowest `size` bytes of `number`, little-endian.
inline void add_little(Bytes& bytes, std::int64_t number, int size) {
  for (int i = 0; i < size; ++i)
    bytes.push_back(static_cast<std::uint8_t>(static_cast<std::uint64_t>(number) >> (8 * i)));
}

inline void add_big(Bytes& bytes, std::uint32_t number) {
  for (int i = 3; i >= 0; --i) bytes.push_back(static_cast<std::uint8_t>(number >> (8 * i)));
}

// AEDAT 2.0

inline Bytes aedat2_header(std::string_view chip) {
  Bytes bytes;
  add(bytes, "#!AER-DAT2.0\r\n# This is a raw AE data file - do not edit\r\n");
  if (!chip.empty()) add(bytes, "# AEChip: " + std::string(chip) + "\r\n");
  return bytes;
}

inline std::uint32_t davis_address(const AbsoluteEvent& event, SensorSize size) {
  return static_cast<std::uint32_t>((size.height - 1 - event.y()) << 22 |
                                    (size.width - 1 - event.x) << 12 |
                                    (event.polarity() == Polarity::on ? 1 : 0) << 11);
}

inline std::uint32_t dvs128_address(const AbsoluteEvent& event) {
  return static_cast<std::uint32_t>((127 - event.y()) << 8 | (127 - event.x) << 1 |
                                    (event.polarity() == Polarity::on ? 0 : 1));
}

/// As v2e makes those of 640x480 pixels.
inline std::uint32_t dvs640_address(const AbsoluteEvent& event) {
  return static_cast<std::uint32_t>((479 - event.y()) << 11 | (639 - event.x) << 1 |
                                    (event.polarity() == Polarity::on ? 1 : 0));
}

inline void add_record(Bytes& bytes, std::uint32_t address, Microseconds t) {
  add_big(bytes, address);
  add_big(bytes, static_cast<std::uint32_t>(t));
}

/// A header, and the records of events whose address is `address_of(event)`.
template <class AddressOf>
Bytes aedat2(Bytes bytes, std::span<const AbsoluteEvent> events, const AddressOf& address_of) {
  for (const auto& event : events) add_record(bytes, address_of(event), event.t);
  return bytes;
}

inline Bytes aedat2_davis(std::span<const AbsoluteEvent> events, SensorSize size,
                          std::string_view chip) {
  auto bytes = aedat2_header(chip);
  add(bytes, "#End Of ASCII Header\r\n");
  return aedat2(bytes, events, [&](const auto& event) { return davis_address(event, size); });
}

inline Bytes aedat2_dvs128(std::span<const AbsoluteEvent> events) {
  auto bytes = aedat2_header("ch.unizh.ini.jaer.chip.retina.DVS128");
  add(bytes, "#End Of ASCII Header\r\n");
  return aedat2(bytes, events, dvs128_address);
}

/// What v2e writes, which names no camera; `size_line` is a line more.
inline Bytes aedat2_v2e(std::span<const AbsoluteEvent> events, SensorSize size,
                        std::string_view size_line = "") {
  Bytes bytes;
  add(bytes, "#!AER-DAT2.0\r\n# This is a raw AE data file created by AEDat2Output in v2e\r\n");
  add(bytes, size_line);
  return aedat2(bytes, events, [&](const auto& event) {
    return size.width == 640 ? dvs640_address(event) : davis_address(event, size);
  });
}

/// What MATLAB's saveaerdat.m writes of a DVS128.
inline Bytes aedat2_of_matlab(std::span<const AbsoluteEvent> events) {
  Bytes bytes;
  add(bytes, "#!AER-DAT2.0\r\n# This is a raw AE data file created by saveaerdat.m\r\n");
  return aedat2(bytes, events, dvs128_address);
}

// AEDAT 1.0

inline Bytes aedat1(std::span<const AbsoluteEvent> events) {
  Bytes bytes;
  add(bytes, "#!AER-DAT1.0\r\n# This is a raw AE data file - do not edit\r\n");
  for (const auto& event : events) {
    const auto address = dvs128_address(event);
    bytes.push_back(static_cast<std::uint8_t>(address >> 8));
    bytes.push_back(static_cast<std::uint8_t>(address));
    add_big(bytes, static_cast<std::uint32_t>(event.t));
  }
  return bytes;
}

// AEDAT 3.1

inline Bytes aedat3_header(std::string_view source) {
  Bytes bytes;
  add(bytes, "#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: " + std::string(source) +
                 "\r\n#Start-Time: 2020-01-01 00:00:00 (TZ+0000)\r\n#!END-HEADER\r\n");
  return bytes;
}

inline void add_aedat3_packet_header(Bytes& bytes, int type, int event_size, std::int64_t overflow,
                                     std::int64_t number) {
  add_little(bytes, type, 2);
  add_little(bytes, 1, 2);
  for (const auto field :
       {std::int64_t{event_size}, std::int64_t{4}, overflow, number, number, number})
    add_little(bytes, field, 4);
}

/// A packet ends at a wrap of the times, or after `max_events`.
inline Bytes aedat3(std::span<const AbsoluteEvent> events, std::string_view source,
                    std::size_t max_events) {
  auto bytes = aedat3_header(source);
  while (!events.empty()) {
    const auto overflow = events.front().t >> 31;
    std::size_t count = 0;
    while (count < events.size() && count < max_events && events[count].t >> 31 == overflow)
      ++count;
    add_aedat3_packet_header(bytes, 1, 8, overflow, static_cast<std::int64_t>(count));
    for (const auto& event : events.first(count)) {
      add_little(bytes,
                 std::int64_t{event.x} << 17 | event.y() << 2 |
                     (event.polarity() == Polarity::on ? 2 : 0) | 1,
                 4);
      add_little(bytes, event.t & 0x7fffffff, 4);
    }
    events = events.subspan(count);
  }
  return bytes;
}

// AEDAT 4, without compression

inline constexpr std::string_view xml_of_one_stream =
    "<dv version=\"2.0\"><node name=\"outInfo\" path=\"/mainloop/Recorder/outInfo/\">"
    "<node name=\"0\" path=\"/mainloop/Recorder/outInfo/0/\">"
    "<attr key=\"typeIdentifier\" type=\"string\">EVTS</attr>"
    "<node name=\"info\" path=\"/mainloop/Recorder/outInfo/0/info/\">"
    "<attr key=\"sizeX\" type=\"int\">346</attr><attr key=\"sizeY\" type=\"int\">260</attr>"
    "</node></node></node></dv>";

/// Shifts the content of a FlatBuffer's body, whose first number is the position of the root.
inline Bytes moved(const Bytes& body, std::size_t by) {
  Bytes bytes;
  add_little(bytes, body[0] + static_cast<std::int64_t>(by), 4);
  bytes.insert(bytes.end(), body.begin() + 4, body.begin() + 8);
  bytes.resize(bytes.size() + by);
  bytes.insert(bytes.end(), body.begin() + 8, body.end());
  return bytes;
}

/// `xml` is the text of the header, unless empty. 8-byte numbers are aligned to 8 bytes relative to
/// the body's size prefix, plus `off_by` bytes.
inline Bytes aedat4_header(std::string_view xml, int compression = 0, std::int64_t table = -1,
                           std::size_t off_by = 0) {
  Bytes body;
  add_little(body, 20, 4);  // to the root
  add(body, "IOHE");
  add_little(body, 10, 2);                    // 8: the vtable: its size,
  add_little(body, 20, 2);                    //    the table's,
  add_little(body, 4, 2);                     //    where compression is,
  add_little(body, 8, 2);                     //    the table's position,
  add_little(body, xml.empty() ? 0 : 16, 2);  //    the text
  add_little(body, 0, 2);
  add_little(body, 12, 4);  // 20: back to the vtable
  add_little(body, compression, 4);
  add_little(body, table, 8);
  add_little(body, 4, 4);  // 36: to the text
  add_little(body, static_cast<std::int64_t>(xml.size()), 4);
  add(body, xml);
  body.push_back(0);
  body = moved(body, off_by);
  Bytes bytes;
  add(bytes, "#!AER-DAT4.0\r\n");
  add_little(bytes, static_cast<std::int64_t>(body.size()), 4);
  add(bytes, body);
  return bytes;
}

/// FlatBuffer of one table with one vector of `count` elements, at the front of `elements`.
inline Bytes vector_packet(std::string_view identifier, const Bytes& elements, std::size_t count,
                           std::size_t off_by = 0) {
  Bytes body;
  add_little(body, 16, 4);  // to the root
  add(body, identifier);
  add_little(body, 6, 2);  // 8: the vtable
  add_little(body, 8, 2);
  add_little(body, 4, 2);
  add_little(body, 0, 2);
  add_little(body, 8, 4);  // 16: back to the vtable
  add_little(body, 4, 4);  // to the vector
  add_little(body, static_cast<std::int64_t>(count), 4);
  add(body, elements);
  body = moved(body, off_by);
  Bytes bytes;
  add_little(bytes, static_cast<std::int64_t>(body.size()), 4);
  add(bytes, body);
  return bytes;
}

inline Bytes events_content(std::span<const AbsoluteEvent> events) {
  Bytes elements;
  for (const auto& event : events) {
    add_little(elements, event.t, 8);
    add_little(elements, event.x, 2);
    add_little(elements, event.y(), 2);
    add_little(elements, event.polarity() == Polarity::on ? 1 : 0, 4);
  }
  return vector_packet("EVTS", elements, events.size());
}

struct TriggerSource {
  Microseconds t;
  int source;  ///< value in AEDAT 4
};

/// Tables with a 64-bit time and, unless omitted, a byte.
inline Bytes triggers_content(std::span<const TriggerSource> triggers, std::size_t off_by = 0) {
  const auto count = static_cast<std::int64_t>(triggers.size());
  const auto first = (4 * count + 8 + 7) / 8 * 8;  // of the tables, from the vector's data
  Bytes elements;
  for (std::int64_t i = 0; i < count; ++i) add_little(elements, first + 16 * i - 4 * i, 4);
  while (elements.size() + 8 < static_cast<std::size_t>(first)) elements.push_back(0);
  add_little(elements, 8, 2);  // the vtable
  add_little(elements, 16, 2);
  add_little(elements, 8, 2);
  add_little(elements, 4, 2);
  for (std::int64_t i = 0; i < count; ++i) {
    add_little(elements, 8 + 16 * i, 4);  // back to the vtable
    add_little(elements, triggers[static_cast<std::size_t>(i)].source, 4);
    add_little(elements, triggers[static_cast<std::size_t>(i)].t, 8);
  }
  return vector_packet("TRIG", elements, triggers.size(), off_by);
}

inline void add_packet(Bytes& bytes, int stream, const Bytes& payload) {
  add_little(bytes, stream, 4);
  add_little(bytes, static_cast<std::int64_t>(payload.size()), 4);
  add(bytes, payload);
}

}  // namespace eventcamera::aedat_files
