// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "src/core/event.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// How each packet of an AEDAT4 file is compressed; the numbers are the file's.
enum class Aedat4Compression : std::uint8_t {
  none = 0,
  lz4 = 1,
  lz4_high = 2,
  zstd = 3,
  zstd_high = 4,
};

/// What a stream of an AEDAT4 file carries.
enum class Aedat4Kind : std::uint8_t { events, frames, triggers, imu, other };

/// One of the streams in an AEDAT4 file.
struct Aedat4Stream {
  int id = 0;  ///< each of its packets names it
  Aedat4Kind kind = Aedat4Kind::other;
  SensorSize size;     ///< 0x0 where the file does not say
  std::string source;  ///< the camera's name
};

/// How a frame's pixels lie; the numbers are the file's.
enum class Aedat4PixelFormat : std::uint8_t { grey8 = 0, grey16 = 2, bgr = 16, bgra = 24 };

constexpr int bytes_per_pixel(Aedat4PixelFormat format) {
  switch (format) {
    case Aedat4PixelFormat::grey8:
      return 1;
    case Aedat4PixelFormat::grey16:
      return 2;
    case Aedat4PixelFormat::bgr:
      return 3;
    case Aedat4PixelFormat::bgra:
      return 4;
  }
  return 0;
}

/// A picture of a stream of frames.
struct Aedat4Frame {
  Microseconds t = 0;
  Microseconds begin = 0;
  Microseconds end = 0;
  Microseconds exposure_begin = 0;
  Microseconds exposure_end = 0;
  Aedat4PixelFormat format = Aedat4PixelFormat::grey8;
  int width = 0;
  int height = 0;
  int x = 0;  ///< of its left column on the sensor
  int y = 0;  ///< of its top row
  const std::uint8_t* pixels = nullptr;
  std::ptrdiff_t stride = 0;  ///< bytes from row to row
};

/// The file's first line.
constexpr std::string_view aedat4_magic = "#!AER-DAT4.0\r\n";

/// The bytes before a packet's payload: the stream's id and the payload's size.
constexpr std::size_t aedat4_packet_header = 8;

/// The largest payload, and the largest content of one, that is read. An uncompressed colour frame
/// of 4096x2304 pixels fits.
constexpr std::size_t aedat4_largest_packet = std::size_t{64} << 20;

/// Times further from zero than this are corruption: 36,000 years.
constexpr Microseconds aedat4_last_time = Microseconds{1} << 60;

}  // namespace eventcamera
