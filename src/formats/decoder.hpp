// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/decoded.hpp"
#include "src/formats/seek_points.hpp"
#include "src/formats/unsupported_format.hpp"

// Guide to this folder: from the bytes of a file to intervals of events, and back.
//
// file_formats.cpp              the table of formats, and which one a file has
// decoder.hpp                   bytes of one event format -> events and triggers (Decoded)
//   unit_stream_decoder.cpp       a header and units of a few bytes, which a UnitDecoder reads:
//                                 evt/, dat/, es/; time_base.hpp unwraps their times
//   event_table.cpp               rows or columns of numbers: text/, numpy/, hdf5/;
//                                 table_sample.cpp guesses what the columns mean
// recording_decoder.hpp         bytes of any file -> items of several streams: aedat/, hdf5/, and
//                                 with one_stream_decoder.cpp every Decoder; ros/: messages of a
//                                 BagFile, a stream per topic
// recording_reader.cpp          plays a recording: origin, duration, sensor size, seeks, counts
//   sensor_sizes.hpp              the size of a sensor that the file does not state
//   seek_points.hpp               where to resume reading
//   chunker.cpp                   events -> intervals of equal length, sorted
//   waiting_items.hpp             triggers and IMU samples that wait for their interval
// encoder.hpp                   events -> bytes, in units by word_writer.hpp
// byte_source.hpp               random access to the bytes of a file
// collected_bytes.hpp           the same for bytes that are pushed
// corruption.hpp                what was wrong with the bytes, and where

namespace eventcamera {

/// Bytes at the end of a file that are read to find its last event; covers the disorder of events.
constexpr std::size_t tail_size = std::size_t{1} << 16;

/// Decodes one event format. Bytes are passed in pieces of any size; the split does not affect the
/// result. Memory is bounded by the size of the pieces and the format's largest unit, never by a
/// length stated in the bytes.
class Decoder {
 public:
  virtual ~Decoder() = default;
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  /// Appends all events and triggers completed by `bytes`. Throws UnsupportedFormat.
  virtual void decode(std::span<const std::uint8_t> bytes, Decoded& out) = 0;

  /// Declares the end of the bytes: appends what is complete and reports a partial rest as
  /// corruption. Throws UnsupportedFormat if the header is incomplete.
  virtual void finish(Decoded& out) = 0;

  /// Where to restart to get every event at `t` or later, and some before. None before the header
  /// is read, and for formats that can only be read from the start. Because times wrap in many
  /// formats, seek points exist only for the part that was read; a seek past it restarts at the
  /// last one.
  std::optional<SeekPoint> seek_point_before(Microseconds t) const {
    return seek_points_.before(t);
  }

  /// Continues at a seek point: the next bytes are those at its position. Corruption that is read
  /// again counts again.
  virtual void restart(const SeekPoint& /*seek_point*/) {}

  /// Appends the last events of the file, if they can be decoded without reading all events before.
  /// Must be called after the header was read.
  virtual void decode_tail(ByteSource& /*source*/, Decoded& /*out*/) const {}

  /// Sensor size, once the header is read or if known from elsewhere; 0x0 before.
  SensorSize size() const { return size_; }

  /// Whether columns count from the right and rows from the bottom: whoever knows the size has to
  /// mirror the events.
  bool is_mirrored() const { return is_mirrored_; }

  /// Whether events carry labels; known once the first are decoded.
  bool has_labels() const { return has_labels_; }

  const Corruption& corruption() const { return corruption_; }

 protected:
  Decoder() = default;

  SensorSize size_;
  bool is_mirrored_ = false;
  bool has_labels_ = false;
  Corruption corruption_;
  SeekPoints seek_points_;
};

}  // namespace eventcamera
