// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "src/formats/chunker.hpp"
#include "src/formats/recording_input.hpp"
#include "src/formats/recording_survey.hpp"
#include "src/formats/sensor_sizes.hpp"
#include "src/formats/waiting_items.hpp"

namespace eventcamera {

/// Plays a recording: turns the items of its decoder into chunks of events, frames, triggers and
/// IMU samples, timed from a common origin, the time of the first event or frame. Knows streams,
/// duration and seek points, and counts items read and dropped.
///
/// The first items are held until the time origin is known. In pull mode the start of the file is
/// surveyed first: this gives an exact or estimated duration, and the sensor size if the file does
/// not state it.
///
///     recording.push(bytes);  // or open(), once
///     while (const auto output = recording.next()) ...
class RecordingReader {
 public:
  using MakeDecoder = RecordingInput::MakeDecoder;

  /// Source of output times: the file's own times, or the PTS of the buffers that carry encoded
  /// words.
  enum class Clock : std::uint8_t { file, stream };

  RecordingReader(MakeDecoder make_decoder, Microseconds chunk_length, Clock clock = Clock::file);

  /// Origin of a sensor size. An assumed size grows with the events: info.size covers each chunk
  /// before it is returned.
  enum class SizeFrom : std::uint8_t { file, user, assumption };

  /// A stream of the file.
  struct Stream {
    StreamInfo info;
    SizeFrom size_from = SizeFrom::file;
    unsigned number = 0;                    ///< index among streams of its kind
    bool shown = false;                     ///< it has items, or may have some
    Microseconds position = 0;              ///< end of its items and gaps so far
    std::optional<std::uint64_t> end = {};  ///< of its part of the segment in the file, if known
    std::uint64_t outside = 0;              ///< events outside a size not stated in the file
    std::optional<Frame> first_frame = {};  ///< format only: its pixels are no longer valid
    bool is_implausible = false;            ///< no sensor is so large as an assumed one had to be
    Extent extent = {};                     ///< of an assumed size
    Chunker chunker;
  };

  /// More streams are shown. Precedes the first item of each of them.
  struct Start {};

  /// Events of an interval, timed from its start, which counts from the origin.
  struct Chunk {
    std::size_t stream;
    Microseconds start;
    Microseconds duration;
    std::span<const Event> events;       ///< none: a gap, in a stream of any kind
    std::span<const Label> labels = {};  ///< of the events, or none
  };

  /// A frame and its time since the origin.
  struct TimedFrame {
    std::size_t stream;
    Microseconds time;
    Frame frame;
  };

  /// Triggers and IMU samples precede the chunk of their interval. Their times, too, are
  /// microseconds since the origin; the first may be before it.
  using Output = std::variant<Start, Chunk, TimedFrame, TriggerItem, ImuItem>;

  /// Stream time of a buffer of encoded words.
  struct Interval {
    Microseconds start;
    Microseconds duration;
  };

  /// Push mode: adds bytes, which must stay valid until next() returns nothing or discard() is
  /// called. Words may have an `interval`: their clock is shifted so that the first event lies
  /// within it.
  void push(std::span<const std::uint8_t> bytes, std::optional<Interval> interval = std::nullopt);

  /// Push mode: marks the end of the bytes.
  void finish() { input_.finish(); }

  /// Words: nothing earlier than `t` will follow. False if no event was read yet.
  bool reach(Microseconds t);

  /// Reads the pushed bytes and drops their items.
  void discard() { input_.discard(); }

  /// Words: the next ones do not continue those before.
  void interrupt();

  /// Words: the next ones do, but not the times of their intervals.
  void begin_times();

  /// Pull mode: sets the source of bytes, which must outlive this object. Call before next().
  void open(ByteSource& source) { input_.open(source); }

  /// Returns the next item, valid until the next call. Nothing if more bytes are needed, if bytes
  /// cannot be read, and after the end. May throw.
  std::optional<Output> next();

  /// True once everything up to the end of the file was returned.
  bool at_end() const { return drained_; }

  /// True once everything up to the end of the segment was returned.
  bool is_past_stop() const;

  /// Pull mode: continues with items at `start` or later, up to `stop`, in time since the origin.
  void seek(Microseconds start, std::optional<Microseconds> stop);

  /// Push mode: where to resume pushing bytes for a seek to `start`; nothing means the start of the
  /// file. May be called from any thread.
  std::optional<SeekPoint> seek_point_before(Microseconds start) const;

  /// Push mode: the next bytes are those at the seek point, or at the start of the file if there is
  /// none.
  void restart(const std::optional<SeekPoint>& seek_point, Microseconds start,
               std::optional<Microseconds> stop);

  const std::vector<Stream>& streams() const { return streams_; }

  /// Replaces an assumed size. Events outside it are dropped.
  void set_size(std::size_t stream, SensorSize size) {
    streams_[stream].info.size = size;
    streams_[stream].size_from = SizeFrom::user;
  }

  std::string format_name() const { return input_.decoder().format_name(); }

  /// Content that was ignored; see Decoder.
  std::string left_out() const { return input_.decoder().left_out(); }

  /// True if no events and frames were found before the Start.
  bool is_empty() const { return !survey_.origin(); }

  /// Time in the file that output times count from; valid after a Start.
  Microseconds origin() const { return origin_; }

  /// Duration of the file, if known: stored in it, measured or estimated.
  std::optional<Microseconds> duration() const { return duration_; }
  bool is_duration_exact() const { return duration_is_exact_; }

  /// End of the returned items, in time since the origin.
  Microseconds position() const { return newest_; }

  /// Numbers of items read and dropped since the start or the last seek.
  struct Counts {
    std::uint64_t events = 0;
    std::uint64_t frames = 0;
    std::uint64_t triggers = 0;
    std::uint64_t imu_samples = 0;
    std::uint64_t corrupt_places = 0;
    std::uint64_t outside = 0;  ///< events outside the sensor
    std::uint64_t skipped = 0;  ///< valid items that are no pixel events
    std::uint64_t late = 0;     ///< events and frames of an interval already returned
    std::uint64_t stray = 0;    ///< events and frames with an erroneous time
  };
  Counts counts() const;

  /// The first corruption of the file.
  const Corruption& corruption() const { return input_.decoder().corruption(); }

 private:
  std::optional<Item> next_item();
  void learn_streams();
  bool survey();
  void begin();
  void begin_segment(Microseconds start, std::optional<Microseconds> stop);

  void show(std::size_t index);
  void start_chunker(std::size_t index);
  void take(const EventItem& item);
  static void grow(Stream& stream, std::span<const AbsoluteEvent> events);
  void take(const FrameItem& item);
  void take(const TriggerItem& item);
  void take(const ImuItem& item);
  std::optional<Output> next_output();
  std::optional<Output> next_accompanying(Microseconds end);
  template <class Sample>
  std::span<const Sample> taken_before(Microseconds end, WaitingItems<Sample>& waiting);
  std::optional<Chunk> next_chunk();
  std::optional<Chunk> next_chunk(std::size_t index);
  std::optional<Chunk> next_gap();
  void cut_at_stop(Chunk& chunk) const;
  bool advance(Stream& stream, Microseconds start, Microseconds end);
  void set_shift(Microseconds first);
  void finish_chunkers();

  RecordingInput input_;
  Microseconds chunk_length_;
  Clock clock_;
  RecordingSurvey survey_;
  std::atomic<Microseconds> origin_ = 0;  ///< read by seek_point_before()

  std::vector<Stream> streams_;  ///< same indices as in the decoder
  bool begun_ = false;           ///< the origin is known
  bool start_due_ = false;
  bool finishing_ = false;  ///< no more items
  bool drained_ = false;    ///< no more chunks either

  Microseconds start_ = 0;
  std::optional<Microseconds> stop_;
  std::optional<Microseconds> duration_;
  bool duration_is_exact_ = false;

  std::optional<Interval> interval_;   ///< interval of the words being read
  std::optional<Microseconds> shift_;  ///< offset from the words' clock to stream time
  std::vector<AbsoluteEvent> within_;  ///< events within a size not stated in the file
  std::optional<Output> output_due_;   ///< a frame or a chunk
  WaitingItems<Trigger> triggers_;     ///< with times of the file
  WaitingItems<ImuSample> imu_samples_;
  std::size_t next_stream_ = 0;  ///< next stream to ask for a chunk
  Microseconds newest_ = 0;      ///< maximum position of all streams
  Corruption before_;            ///< the decoder's corruption at its last restart
  Counts counts_;                ///< without those that decoder and chunkers count
};

}  // namespace eventcamera
