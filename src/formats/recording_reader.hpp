// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "src/formats/byte_source.hpp"
#include "src/formats/chunker.hpp"
#include "src/formats/decoder.hpp"
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
/// A table with more than one row in a hundred far out of order is sorted if the survey detects
/// this and the table fits into memory; otherwise it is refused, even after events were returned.
///
///     recording.push(bytes);  // or open(), once
///     while (const auto output = recording.next()) ...
class RecordingReader {
 public:
  /// Creates a decoder of the file, positioned at its start. May throw.
  using MakeDecoder = std::function<std::unique_ptr<Decoder>()>;

  /// Source of output times: the file's own times, or the PTS of the buffers that carry encoded
  /// words.
  enum class Clock : std::uint8_t { file, stream };

  RecordingReader(MakeDecoder make_decoder, Microseconds chunk_length, Clock clock = Clock::file);

  /// Origin of a sensor size. An assumed size grows with the events: info.size covers each chunk
  /// before it is returned.
  enum class SizeFrom : std::uint8_t { file, user, assumption };

  struct Stream {
    StreamInfo info;
    SizeFrom size_from = SizeFrom::file;
    unsigned number = 0;                    ///< index among streams of its kind
    bool shown = false;                     ///< it has items, or may have some
    Microseconds position = 0;              ///< end of its items and gaps so far
    std::optional<std::uint64_t> end = {};  ///< of its items in the segment, in the file, if known
    std::uint64_t outside = 0;              ///< events outside a size not stated in the file
    std::optional<Frame> first_frame = {};  ///< format only: its pixels are no longer valid
    bool is_implausible = false;            ///< no sensor is as large as the assumed size
    Extent extent = {};                     ///< of an assumed size
    Chunker chunker;                        ///< before the origin is known, rejects erroneous times

    // Known from the items before the first Start.
    std::optional<Microseconds> first = {};   ///< earliest time
    std::optional<Microseconds> latest = {};  ///< latest time
    UsedPixels used = {};
    bool is_sampled = false;  ///< `used` covers at least one interval
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

  /// Words: declares that nothing earlier than `t` will follow.
  void advance_to(Microseconds t);

  /// Words: true once the time of the first event is known.
  bool has_events() const { return streams_.front().chunker.first().has_value(); }

  /// Reads the pushed bytes and drops their items.
  void discard() { input_.discard(); }

  /// Words: the next ones start over, with unknown state and times.
  void interrupt();

  /// Words: the next ones continue the words, but not the times of the intervals.
  void begin_times();

  /// Pull mode: sets the source of bytes, which must outlive this object. Call before next().
  void open(ByteSource& source) { input_.open(source); }

  /// Returns the next item, valid until the next call. Nothing if more bytes are needed, if bytes
  /// cannot be read, and after the end. May throw.
  std::optional<Output> next();

  /// Exchanges the memory of the last chunk's events, of this stream, for other memory. The events
  /// stay valid in the former.
  void swap_memory(std::size_t stream, std::vector<Event>& memory) {
    streams_[stream].chunker.swap_memory(memory);
  }

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

  UnreadStreams unread_streams() const { return input_.decoder().unread_streams(); }

  /// True if no events and frames were found before the Start.
  bool is_empty() const { return !earliest(); }

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
    std::uint64_t late = 0;     ///< events and frames whose interval was already returned
    std::uint64_t stray = 0;    ///< events and frames with an erroneous time
  };
  Counts counts() const;

  /// True if the file is a table that had to be sorted.
  bool is_sorted() const { return input_.is_sorted(); }

  const Corruption& corruption() const { return input_.decoder().corruption(); }

 private:
  /// The items of the decoder, and the bytes that they are decoded from.
  class Input {
   public:
    explicit Input(MakeDecoder make_decoder)
        : make_decoder_(std::move(make_decoder)), decoder_(make_decoder_()) {}

    void open(ByteSource& source) { source_ = &source; }
    bool is_pulling() const { return source_ != nullptr; }
    const ByteSource& source() const { return *source_; }

    void push(std::span<const std::uint8_t> bytes);
    void finish();
    bool is_finished() const { return is_finished_; }

    /// Further bytes may follow the end.
    void expect_more() { is_finished_ = false; }

    /// Returns the next item, valid until the next call. Nothing if more bytes are needed, if bytes
    /// cannot be read, and after the end. May throw.
    std::optional<Item> next();

    /// Drops the items of all bytes so far.
    void discard();

    /// Keeps a copy of an item until restart().
    void hold(Item item);

    /// Size of the held items in memory, in bytes.
    std::size_t held_size() const { return held_size_; }

    /// Sorts the held events, which are all of the file. From now on, every restart() leads to the
    /// start of these.
    void sort_held();
    bool is_sorted() const { return sorted_.has_value(); }

    /// The next items are the held ones.
    void replay() { replayed_ = 0; }

    /// Continues at a seek point, or with a new decoder at the start of the file.
    void restart(const std::optional<SeekPoint>& seek_point);

    /// May be called from any thread.
    std::optional<SeekPoint> seek_point_before(Microseconds t) const;

    /// True if all items before this position in the file were returned.
    bool has_passed(std::uint64_t position) const {
      return held_.empty() && decoder_->position() >= position;
    }

    Decoder& decoder() { return *decoder_; }
    const Decoder& decoder() const { return *decoder_; }

    /// Pull mode: true if the decoder reads from the source.
    bool reads_itself() const { return reads_itself_; }

    /// Offset of the next byte to push or pull, unless the decoder reads itself.
    std::uint64_t position() const { return position_; }

   private:
    /// An item, and the memory that it refers to.
    struct Held {
      Item item;
      std::vector<std::byte> memory;
    };

    std::unique_lock<std::mutex> lock() const { return std::unique_lock(mutex_); }
    std::optional<Item> decode();
    void clear_held();

    MakeDecoder make_decoder_;
    mutable std::mutex mutex_;  ///< guards decoder_ against seek_point_before()
    std::unique_ptr<Decoder> decoder_;

    ByteSource* source_ = nullptr;
    bool reads_itself_ = false;
    std::uint64_t position_ = 0;
    bool is_finished_ = false;

    std::vector<Held> held_;
    std::size_t held_size_ = 0;
    std::optional<std::size_t> replayed_;               ///< number of held items returned again
    std::optional<std::vector<AbsoluteEvent>> sorted_;  ///< all events
    std::size_t returned_ = 0;                          ///< of them
  };

  std::optional<Item> next_item();
  void learn_streams();

  bool survey();
  bool is_surveyed();
  std::optional<Chunker::Disorder> disorder() const;
  void sort_events();
  bool find_first_items();
  void learn_duration(std::optional<Microseconds> stated, bool is_whole);
  bool is_origin_known() const;
  std::optional<Microseconds> earliest() const;
  std::optional<Item> survey_next();
  void survey(const EventItem& item);
  void survey(const FrameItem& item);
  void survey(const TriggerItem& /*item*/) {}
  void survey(const ImuItem& /*item*/) {}
  void finish_survey(Stream& stream);
  void begin();
  void begin_segment(Microseconds start, std::optional<Microseconds> stop);

  void show(std::size_t index);
  void forget_output(Microseconds start);
  void start_chunker(Stream& stream);
  void add(const EventItem& item);
  void add(const FrameItem& item);
  void add(const TriggerItem& item);
  void add(const ImuItem& item);
  static void grow(Stream& stream, std::span<const AbsoluteEvent> events);
  std::optional<Output> next_output();
  std::optional<Output> next_accompanying(Microseconds end);
  template <class Sample>
  std::span<const Sample> samples_before(Microseconds end, WaitingItems<Sample>& waiting);
  std::optional<Chunk> next_chunk();
  std::optional<Chunk> next_chunk(std::size_t index);
  std::optional<Chunk> next_gap();
  void cut_at_stop(Chunk& chunk) const;
  bool advance(Stream& stream, Microseconds start, Microseconds end);
  void set_shift(Microseconds first);
  void finish_chunkers();

  Input input_;
  Microseconds chunk_length_;
  Clock clock_;
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
