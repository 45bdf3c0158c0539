// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>
#include <cstdint>

namespace eventcamera {

/// Formats of UDP datagrams of other tools.
enum class DatagramFormat : std::uint8_t {
  spif,             ///< SpiNNaker, AEStream, EventCV; no timestamps
  spif_timestamps,  ///< the same, with timestamps
  t64_x16_y16_on8,  ///< faery
  t32_x16_y15_on1,  ///< faery
  es,               ///< Event Stream
  jaer,             ///< jAER's AER-UDP
};

/// Settings that sender and receiver must share; they are not part of the datagrams.
struct DatagramSettings {
  DatagramFormat format = DatagramFormat::spif;
  int width = 0;                                 ///< of the sensor, in pixels
  int height = 0;                                ///< of the sensor, in pixels
  std::endian byte_order = std::endian::little;  ///< of SPIF; the other formats define theirs
  bool has_sequence_number = true;               ///< in datagrams of jAER
};

}  // namespace eventcamera
