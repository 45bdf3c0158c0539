// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>

#include "gst/base/element_type.hpp"
#include "gst/base/properties.hpp"
#include "src/wire/datagrams.hpp"

/// Counts of datagrams. Losses are known only if datagrams have a sequence number.
struct DatagramCounts {
  guint64 packets = 0;
  guint64 events = 0;
  guint64 bytes = 0;
  guint64 lost = 0;
  guint64 late = 0;
  guint64 rejected = 0;
};

inline GType datagram_format_type() {
  using eventcamera::DatagramFormat;
  return enum_type<DatagramFormat>(
      "GstEventDatagramFormat",
      {{DatagramFormat::spif, "SPIF without timestamps: SpiNNaker, AEStream, EventCV", "spif"},
       {DatagramFormat::spif_timestamps, "SPIF with timestamps: SpiNNaker, EventCV",
        "spif-timestamps"},
       {DatagramFormat::t64_x16_y16_on8, "faery, 13 bytes per event", "t64-x16-y16-on8"},
       {DatagramFormat::t32_x16_y15_on1, "faery, 8 bytes per event", "t32-x16-y15-on1"},
       {DatagramFormat::es, "Event Stream", "es"},
       {DatagramFormat::jaer, "jAER's AER-UDP", "jaer"}});
}

inline const char* name_of(eventcamera::DatagramFormat format) {
  auto* formats = static_cast<GEnumClass*>(g_type_class_peek(datagram_format_type()));
  return g_enum_get_value(formats, static_cast<int>(format))->value_nick;
}

inline GType datagram_byte_order_type() {
  return enum_type<std::endian>(
      "GstEventDatagramByteOrder",
      {{std::endian::little, "Little-endian, like AEStream on a PC", "little-endian"},
       {std::endian::big, "Big-endian, network byte order", "big-endian"}});
}

/// Adds the properties that sender and receiver must share. Settings are derived from
/// DatagramSettings.
template <auto settings_of>
void add_datagram_properties(Properties<settings_of>& properties) {
  using eventcamera::DatagramSettings;
  properties.add_fixed(&DatagramSettings::format, "format", "Format of the datagrams",
                       datagram_format_type());
  properties.add_fixed(&DatagramSettings::byte_order, "byte-order",
                       "Byte order of SPIF; the other formats define their own",
                       datagram_byte_order_type());
  properties.add_fixed(&DatagramSettings::has_sequence_number, "sequence-number",
                       "Datagrams of jAER start with a sequence number, which reveals losses");
}
