// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <bit>

#include "gst/base/properties.hpp"
#include "gst/base/types.hpp"
#include "src/wire/datagram_settings.hpp"

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
  static const GEnumValue values[] = {
      {static_cast<int>(DatagramFormat::spif),
       "SPIF without timestamps: SpiNNaker, AEStream, EventCV", "spif"},
      {static_cast<int>(DatagramFormat::spif_timestamps),
       "SPIF with timestamps: SpiNNaker, EventCV", "spif-timestamps"},
      {static_cast<int>(DatagramFormat::t64_x16_y16_on8), "faery, 13 bytes per event",
       "t64-x16-y16-on8"},
      {static_cast<int>(DatagramFormat::t32_x16_y15_on1), "faery, 8 bytes per event",
       "t32-x16-y15-on1"},
      {static_cast<int>(DatagramFormat::es), "Event Stream", "es"},
      {static_cast<int>(DatagramFormat::jaer), "jAER's AER-UDP", "jaer"},
      {0, nullptr, nullptr},
  };
  return enum_type("GstEventDatagramFormat", values);
}

inline const char* name_of(eventcamera::DatagramFormat format) {
  auto* formats = static_cast<GEnumClass*>(g_type_class_peek(datagram_format_type()));
  return g_enum_get_value(formats, static_cast<int>(format))->value_nick;
}

inline GType datagram_byte_order_type() {
  static const GEnumValue values[] = {
      {static_cast<int>(std::endian::little), "Little-endian, like AEStream on a PC",
       "little-endian"},
      {static_cast<int>(std::endian::big), "Big-endian, network byte order", "big-endian"},
      {0, nullptr, nullptr},
  };
  return enum_type("GstEventDatagramByteOrder", values);
}

/// Adds the properties that sender and receiver must share. Settings are derived from
/// DatagramSettings.
template <auto settings_of>
void add_datagram_properties(Properties<settings_of>& properties) {
  using eventcamera::DatagramSettings;
  constexpr DatagramSettings defaults;
  properties.add(
      &DatagramSettings::format,
      g_param_spec_enum("format", "Format", "Format of the datagrams", datagram_format_type(),
                        static_cast<int>(defaults.format), mutable_ready_flags));
  properties.add(&DatagramSettings::byte_order,
                 g_param_spec_enum("byte-order", "Byte order",
                                   "Byte order of SPIF; the other formats define their own",
                                   datagram_byte_order_type(),
                                   static_cast<int>(defaults.byte_order), mutable_ready_flags));
  properties.add(
      &DatagramSettings::has_sequence_number,
      g_param_spec_boolean("sequence-number", "Sequence number",
                           "Datagrams of jAER start with a sequence number, which reveals losses",
                           defaults.has_sequence_number, mutable_ready_flags));
}
