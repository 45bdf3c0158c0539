// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
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

// Guide to this folder: from the bytes of a file to intervals of events, and back.
//
// file_formats.cpp              the table of formats, and recognition by the first bytes
// decoder.hpp                   bytes of a file -> items of its streams: aedat/aedat4, hdf5/, and
//                               ros/: messages of a BagFile, a stream per topic
//                               EventDecoder: a single stream of events and triggers, as aedat/ 1
//                               to 3
//   unit_stream_decoder.cpp       a header and units of a few bytes, which a UnitDecoder reads:
//                                 evt/, dat/, es/
//   event_table.cpp               rows or columns of numbers: text/, numpy/, hdf5/
// recording_reader.hpp          plays a recording: origin, duration, sensor size, seeks, counts
//   sensor_sizes.hpp              sensor size of a file that does not state it
//   chunker.cpp                   events -> intervals of equal length, sorted
//   waiting_items.hpp             triggers and IMU samples that wait for their interval
// encoder.hpp                   events -> bytes, in units by word_writer.hpp
// byte_source.hpp               random access to the bytes of a file, pulled or pushed
// corruption.hpp                position and description of corrupt bytes

namespace eventcamera {

/// Position in a file at which a decoder can resume as if it had read everything before.
struct SeekPoint {
  Microseconds t = 0;  ///< time of the latest event before it; the minimum value if there is none
  std::uint64_t position = 0;  ///< offset in the file, bytes
  Microseconds clock = 0;      ///< private to the decoder
  std::uint64_t state = 0;     ///< private to the decoder
};

/// Seek points of the part of a file that was read. Their number is bounded for files of any
/// length.
class SeekPoints {
 public:
  bool due(std::uint64_t position) const { return position >= next_; }

  void note(const SeekPoint& seek_point) {
    known_.push_back(seek_point);
    if (known_.size() == max_count) {
      for (std::size_t i = 1; i < max_count / 2; ++i) known_[i] = known_[2 * i];
      known_.resize(max_count / 2);
      spacing_ *= 2;
    }
    next_ = seek_point.position + spacing_;
  }

  /// Returns the last seek point without events at `t` or later before it; none before the header
  /// is read.
  std::optional<SeekPoint> before(Microseconds t) const {
    if (known_.empty()) return std::nullopt;
    const auto later = std::partition_point(known_.begin() + 1, known_.end(),
                                            [t](const SeekPoint& known) { return known.t < t; });
    return *(later - 1);
  }

 private:
  static constexpr std::size_t max_count = 4096;

  std::vector<SeekPoint> known_;
  std::uint64_t spacing_ = std::uint64_t{1} << 16;
  std::uint64_t next_ = 0;
};

enum class StreamKind : std::uint8_t { events, frames, triggers, imu, other };

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

struct FrameItem {
  std::size_t stream;
  Frame frame;
};

struct TriggerItem {
  std::size_t stream;
  std::span<const Trigger> triggers;
};

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

  /// Declares the end of the bytes: next() returns the rest.
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

  /// Returns where to restart for everything at `t` or later; nothing if only a new decoder at the
  /// start of the file can do that.
  virtual std::optional<SeekPoint> seek_point_before(Microseconds t) const = 0;

  /// Continues at a seek point: the next bytes are those at its position.
  virtual void restart(const SeekPoint& seek_point) = 0;

  /// Time of the last event or frame, if the file states it.
  virtual std::optional<Microseconds> last_time() { return std::nullopt; }

  /// Position after the last item of a stream before `t`, if the file states it; 0 if there is
  /// none.
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

  /// True for tables, whose rows may be in any order. Cameras write events in order of time.
  virtual bool is_table() const { return false; }

  /// Name of the format for users; empty if it adds nothing to the media type.
  virtual std::string format_name() const { return {}; }

 protected:
  Decoder() = default;
};

/// Bytes at the end of a file that are read to find its last event; covers the disorder of events.
constexpr std::size_t tail_size = std::size_t{1} << 16;

/// Decodes a format with a single stream, of events and triggers. Bytes are passed in pieces of any
/// size; the split does not affect the result. Memory is bounded by the size of the pieces and the
/// format's largest unit, never by a length stated in the bytes.
class EventDecoder : public Decoder {
 public:
  /// Appends all events and triggers completed by `bytes`. Throws UnsupportedFormat.
  virtual void decode(std::span<const std::uint8_t> bytes, Decoded& out) = 0;

  /// Declares the end of the bytes: appends all complete items and reports a partial one as
  /// corruption. Throws UnsupportedFormat if the header is incomplete.
  virtual void finish(Decoded& out) = 0;

  /// Appends the last events of the file, if they can be decoded without reading all events before.
  /// Must be called after the header was read.
  virtual void decode_tail(ByteSource& /*source*/, Decoded& /*out*/) const {}

  /// Sensor size, once the header is read or if known from elsewhere; 0x0 before.
  SensorSize size() const { return stream_.size; }

  void push(std::span<const std::uint8_t> piece) final { pushed_ = piece; }
  void drain() final { is_draining_ = true; }
  bool open(ByteSource& source) final {
    source_ = &source;
    return false;
  }
  std::optional<Item> next() final;
  const std::vector<StreamInfo>& streams() const final { return streams_; }
  const Corruption& corruption() const final { return corruption_; }

  /// Because times wrap in many formats, seek points exist only for the part that was read; a seek
  /// past it restarts at the last one. None for formats that can only be read from the start.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const final {
    return seek_points_.before(t);
  }
  void restart(const SeekPoint& seek_point) final;
  std::optional<Microseconds> last_time() final;

 protected:
  EventDecoder() = default;

  /// Restores the state at a seek point. Corruption that is read again counts again.
  virtual void restore(const SeekPoint& /*seek_point*/) {}

 private:
  std::vector<StreamInfo> streams_{{.id = 0, .kind = StreamKind::events, .size = {}, .source = {}}};

 protected:
  StreamInfo& stream_ = streams_.front();
  Corruption corruption_;
  SeekPoints seek_points_;

 private:
  ByteSource* source_ = nullptr;           ///< null in push mode, and once the last time is known
  std::optional<Microseconds> last_time_;  ///< if decode_tail() finds it
  std::span<const std::uint8_t> pushed_;   ///< not decoded yet
  bool is_draining_ = false;               ///< finish() is due
  Decoded decoded_;
  bool events_due_ = false;  ///< next() returns the events in decoded_
  bool triggers_due_ = false;
};

}  // namespace eventcamera
