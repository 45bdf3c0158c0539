// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "src/formats/chunker.hpp"
#include "src/formats/reader.hpp"
#include "src/formats/sensor_sizes.hpp"

namespace eventcamera {

/// Plays a recording: what its Reader reads becomes chunks of events, frames and triggers with
/// times from one origin, the time of the first event or frame. Knows streams, duration and seek
/// points, and counts what was read and left out.
///
/// In push mode bytes come as they come, and the first items are held until the time origin is
/// known. In pull mode the start of the file is surveyed first, up to 16 MiB of it: then the
/// duration is exact or estimated, and the size of a sensor that the file does not tell is known.
///
///     recording.push(bytes);  // or open(), once
///     while (const auto output = recording.next()) ...
class RecordingReader {
 public:
  /// Makes the reader of the file, which is at its start. May throw.
  using MakeReader = std::function<std::unique_ptr<Reader>()>;

  /// Whether the times of the file count, or those of a stream of words that carries them.
  enum class Clock : std::uint8_t { file, stream };

  RecordingReader(MakeReader make_reader, Microseconds chunk_length, Clock clock = Clock::file);

  /// One of the streams of the file.
  struct Stream {
    StreamInfo info;
    unsigned number = 0;                 ///< among those of its kind
    bool shown = false;                  ///< it has items, or may have
    bool size_guessed = false;           ///< the file does not tell info.size
    Microseconds position = 0;           ///< where its next item begins at the earliest
    std::uint64_t outside = 0;           ///< events outside a guessed size
    std::optional<Microseconds> first;   ///< its earliest time in the file, as far as surveyed
    std::optional<Microseconds> latest;  ///< its latest one
    std::optional<Frame> first_frame;    ///< for its format: the pixels are gone
    UsedPixels used = {};
    bool is_sampled = false;  ///< used is of an interval at least
    Chunker chunker;
  };

  /// Streams that were not shown before are shown. Comes before the first item of each.
  struct Start {};

  /// Events of an interval. Times are microseconds since the origin.
  struct Chunk {
    std::size_t stream;
    Microseconds start;
    Microseconds duration;
    std::span<const Event> events;  ///< none: a silence, of a stream of any kind
  };

  /// A frame, and its time since the origin.
  struct TimedFrame {
    std::size_t stream;
    Microseconds time;
    Frame frame;
  };

  using Output = std::variant<Start, Chunk, TimedFrame, TriggerItem>;

  /// The time of the stream that words come in.
  struct Interval {
    Microseconds start;
    Microseconds duration;
  };

  /// Push mode: adds bytes, borrowed until next() returns nothing or discard() is called. Words
  /// may say when they are: their clock is moved so that the first event lies within `interval`.
  void push(std::span<const std::uint8_t> bytes, std::optional<Interval> interval = std::nullopt);

  /// Push mode: no more bytes come.
  void finish();

  /// Words: nothing before `t` will come any more. False where no event has come yet.
  bool reach(Microseconds t);

  /// Reads what was pushed, and drops it.
  void discard();

  /// Words: what comes next does not follow on what came.
  void interrupt();

  /// Pull mode: the bytes of the file, which outlive this. Call it before next().
  void open(ByteSource& source) { source_ = &source; }

  /// The next item, valid until the next call. Nothing where that takes more bytes, where bytes
  /// cannot be read, or after the end. May throw.
  std::optional<Output> next();

  /// Whether everything up to the end of the file was handed out.
  bool at_end() const { return drained_; }

  /// Whether everything up to the end of the segment was handed out.
  bool is_past_stop() const;

  /// Pull mode: goes on with what is at `start` or later, up to `stop`, in time since the origin.
  void seek(Microseconds start, std::optional<Microseconds> stop);

  /// Push mode: where bytes have to go on for a seek to `start`; from any thread. The start of the
  /// file where nothing better is known.
  std::optional<SeekPoint> seek_point_before(Microseconds start) const;

  /// Push mode: the next bytes are those at the seek point, or at the start of the file.
  void restart(const std::optional<SeekPoint>& seek_point, Microseconds start,
               std::optional<Microseconds> stop);

  const std::vector<Stream>& streams() const { return streams_; }

  /// Replaces a size that was guessed.
  void set_size(std::size_t stream, SensorSize size) { streams_[stream].info.size = size; }

  std::string format_name() const { return reader_->format_name(); }

  /// The time of the file that output counts from; only after a Start.
  Microseconds origin() const { return origin_; }

  /// The length of the file, where it is known, told by the file or estimated.
  std::optional<Microseconds> duration() const { return duration_; }

  /// Up to where items were handed out, in time since the origin.
  Microseconds position() const { return newest_; }

  /// What was read and left out since the start, or the last seek.
  struct Counts {
    std::uint64_t events = 0;
    std::uint64_t frames = 0;
    std::uint64_t triggers = 0;
    std::uint64_t imu_samples = 0;
    std::uint64_t corrupt_places = 0;
    std::uint64_t outside = 0;   ///< events outside the sensor
    std::uint64_t late = 0;      ///< events and frames whose interval was handed out
    std::uint64_t stray = 0;     ///< events and frames of a time that was an error
    std::uint64_t repeated = 0;  ///< events of the pixel and time of another
  };
  Counts counts() const;

  /// The first corruption of the file.
  const Corruption& corruption() const { return reader_->corruption(); }

 private:
  /// An item from before the origin was known.
  struct HeldItem {
    std::size_t stream;
    std::vector<AbsoluteEvent> events;
    std::optional<Frame> frame;
    std::vector<std::uint8_t> pixels;
  };

  std::unique_lock<std::mutex> reading() const { return std::unique_lock(mutex_); }
  std::optional<Item> read_item();
  std::optional<Item> next_item();
  void learn_streams();

  bool survey();
  void note(const EventItem& item);
  void note(const FrameItem& item);
  void note(const TriggerItem& item);
  void hold(const Item& item);
  bool is_origin_known() const;
  bool is_surveyed(std::uint64_t events) const;
  void begin();
  void learn_duration(std::optional<Microseconds> told, bool is_whole);

  void show(Stream& stream);
  void start_chunker(Stream& stream);
  void take(const EventItem& item);
  void take(const FrameItem& item);
  void take(const TriggerItem& item);
  std::optional<Output> next_output();
  std::optional<Chunk> next_chunk();
  void catch_up();
  bool advance(Stream& stream, Microseconds start, Microseconds end);
  void set_shift(Microseconds first);
  void finish_chunkers();

  MakeReader make_reader_;
  Microseconds chunk_length_;
  Clock clock_;

  mutable std::mutex mutex_;  ///< guards reader_ and origin_ against seek_point_before()
  std::unique_ptr<Reader> reader_;
  Microseconds origin_ = 0;

  ByteSource* source_ = nullptr;  ///< in pull mode
  bool reads_itself_ = false;     ///< the reader, from the source
  std::uint64_t position_ = 0;    ///< of the next byte to pull

  std::vector<Stream> streams_;  ///< the reader's, with the same indices
  bool begun_ = false;           ///< the origin is known
  bool start_due_ = false;
  bool finished_ = false;   ///< there are no more bytes
  bool finishing_ = false;  ///< nor more items
  bool drained_ = false;    ///< nor more chunks
  std::vector<HeldItem> held_;
  std::size_t held_next_ = 0;
  std::size_t held_size_ = 0;  ///< in bytes

  Microseconds start_ = 0;
  std::optional<Microseconds> stop_;
  std::optional<Microseconds> duration_;
  bool duration_is_exact_ = false;

  std::optional<Interval> interval_;   ///< of the words that are read
  std::optional<Microseconds> shift_;  ///< from the clock of words to the stream's
  std::vector<AbsoluteEvent> within_;  ///< a guessed size
  std::optional<Output> output_due_;   ///< a frame or triggers
  std::size_t next_stream_ = 0;        ///< that may have a chunk
  Microseconds newest_ = 0;            ///< the greatest position of a stream
  Microseconds caught_up_ = 0;         ///< newest_, when the others caught up with it
  Corruption before_;                  ///< the reader's, when it was restarted
  std::uint64_t imu_samples_before_ = 0;
  Counts counts_;  ///< but for what reader and chunkers count
};

}  // namespace eventcamera
