// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/seek_points.hpp"
#include "src/formats/unsupported_format.hpp"

// Guide to this folder: from the bytes of a file to intervals of events, and back.
//
// file_formats.cpp              the table of formats, and which one a file has
// decoder.hpp                   bytes of a file -> items of its streams: aedat/aedat4, hdf5/, and
//                               ros/: messages of a BagFile, a stream per topic
//   event_decoder.hpp             files of a single stream of events and triggers: aedat/ 1 to 3
//     unit_stream_decoder.cpp       a header and units of a few bytes, which a UnitDecoder reads:
//                                   evt/, dat/, es/; time_base.hpp unwraps their times
//     event_table.cpp               rows or columns of numbers: text/, numpy/, hdf5/;
//                                   table_sample.cpp guesses what the columns mean
// recording_reader.hpp          plays a recording: origin, duration, sensor size, seeks, counts
//   sensor_sizes.hpp              the size of a sensor that the file does not state
//   seek_points.hpp               where to resume reading
//   chunker.cpp                   events -> intervals of equal length, sorted
//   waiting_items.hpp             triggers and IMU samples that wait for their interval
// encoder.hpp                   events -> bytes, in units by word_writer.hpp
// byte_source.hpp               random access to the bytes of a file
// collected_bytes.hpp           the same for bytes that are pushed
// corruption.hpp                what was wrong with the bytes, and where

namespace eventcamera {

/// Content of a stream of a recording.
enum class StreamKind : std::uint8_t { events, frames, triggers, imu, other };

/// A stream of a recording.
struct StreamInfo {
  int id = 0;  ///< its ID in the file
  StreamKind kind = StreamKind::other;
  SensorSize size;     ///< 0x0 if not stated in the file
  std::string source;  ///< name of the camera
  /// Columns count from the right and rows from the bottom, as the size that turns them is unknown.
  bool mirrored = false;
  bool labelled = false;  ///< its events carry labels
};

/// Pixel format of a frame, with AEDAT4's values.
enum class PixelFormat : std::uint8_t { grey8 = 0, grey16 = 2, bgr = 16, bgra = 24 };

constexpr int bytes_per_pixel(PixelFormat format) {
  switch (format) {
    case PixelFormat::grey8:
      return 1;
    case PixelFormat::grey16:
      return 2;
    case PixelFormat::bgr:
      return 3;
    case PixelFormat::bgra:
      return 4;
  }
  return 0;
}

/// A frame of a camera.
struct Frame {
  Microseconds t = 0;
  Microseconds begin = 0;
  Microseconds end = 0;
  Microseconds exposure_begin = 0;
  Microseconds exposure_end = 0;
  PixelFormat format = PixelFormat::grey8;
  int width = 0;
  int height = 0;
  int x = 0;  ///< left column on the sensor
  int y = 0;  ///< top row on the sensor
  const std::uint8_t* pixels = nullptr;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next
};

/// Sample of a camera's inertial measurement unit.
struct ImuSample {
  Microseconds t = 0;
  float temperature = 0;                     ///< degrees Celsius
  std::array<float, 3> acceleration = {};    ///< along x, y and z, in g
  std::array<float, 3> rotation = {};        ///< around x, y and z, in degrees per second
  std::array<float, 3> magnetic_field = {};  ///< along x, y and z, in microtesla

  friend bool operator==(const ImuSample&, const ImuSample&) = default;
};

/// Events of a stream. `stream` is an index into the decoder's streams().
struct EventItem {
  std::size_t stream;
  std::span<const AbsoluteEvent> events;
};

/// A frame of a stream.
struct FrameItem {
  std::size_t stream;
  Frame frame;
};

/// Triggers of a stream.
struct TriggerItem {
  std::size_t stream;
  std::span<const Trigger> triggers;
};

/// IMU samples of a stream.
struct ImuItem {
  std::size_t stream;
  std::span<const ImuSample> samples;
};

using Item = std::variant<EventItem, FrameItem, TriggerItem, ImuItem>;

/// Streams that are not read but that another setting would read.
struct UnreadStreams {
  std::string names;     ///< for users, such as "topics /a, /b"; empty if there are none
  std::string property;  ///< that selects them
};

/// Events and triggers, to which decoders append.
struct Decoded {
  std::vector<AbsoluteEvent> events;
  std::vector<Trigger> triggers;
};

/// Decodes a recording of any format into items, in file order.
///
///     decoder.push(piece);
///     while (const auto item = decoder.next()) ...
class Decoder {
 public:
  virtual ~Decoder() = default;
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  /// Adds bytes, which must stay valid until next() returns nothing; only then more may be pushed.
  virtual void push(std::span<const std::uint8_t> piece) = 0;

  /// Declares the end of the bytes: next() returns what is left.
  virtual void drain() = 0;

  /// Gives access to all bytes of the file; `source` must outlive the decoder. True if the decoder
  /// reads from it directly and no bytes must be pushed.
  virtual bool open(ByteSource& /*source*/) { return false; }

  /// Returns the next item, valid until the next call; nothing if more bytes are needed. Throws
  /// UnsupportedFormat.
  virtual std::optional<Item> next() = 0;

  /// Streams known so far.
  virtual const std::vector<StreamInfo>& streams() const = 0;

  virtual const Corruption& corruption() const = 0;

  /// Where to restart to get everything at `t` or later; nothing if that takes a new decoder at the
  /// start of the file.
  virtual std::optional<SeekPoint> seek_point_before(Microseconds t) const = 0;

  /// Continues at a seek point: the next bytes are those at its position.
  virtual void restart(const SeekPoint& seek_point) = 0;

  /// Time of the last event or frame, if the file states it.
  virtual std::optional<Microseconds> last_time() { return std::nullopt; }

  /// Position from which on a stream has no items before `t`, if the file states it; 0 if it has
  /// none at all.
  virtual std::optional<std::uint64_t> end_of(std::size_t /*stream*/, Microseconds /*t*/) const {
    return std::nullopt;
  }

  /// Position of the next read, if the file states where streams end.
  virtual std::uint64_t position() const { return 0; }

  /// False if the next items may belong to further streams.
  virtual bool knows_all_streams() const { return true; }

  /// Where to restart for the first item of a stream, if the file states it.
  virtual std::optional<SeekPoint> first_of(std::size_t /*stream*/) const { return std::nullopt; }

  virtual UnreadStreams unread_streams() const { return {}; }

  /// True for tables, whose rows may be in any order; cameras write events in the order of time.
  virtual bool is_table() const { return false; }

  /// Name of the format for users; empty if it adds nothing to the media type.
  virtual std::string format_name() const { return {}; }

 protected:
  Decoder() = default;
};

}  // namespace eventcamera
