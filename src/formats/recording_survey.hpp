// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include "src/formats/chunker.hpp"
#include "src/formats/recording_input.hpp"
#include "src/formats/sensor_sizes.hpp"

namespace eventcamera {

/// True for streams that play by themselves; others accompany them.
constexpr bool is_shown(StreamKind kind) {
  return kind == StreamKind::events || kind == StreamKind::frames;
}

/// What the first items of a recording tell: its time origin, its duration, and sensor sizes that
/// it does not state.
class RecordingSurvey {
 public:
  /// A stream, as far as it was read.
  struct Stream {
    Chunker chunker;                          ///< rejects erroneous times
    std::optional<Microseconds> first = {};   ///< earliest time
    std::optional<Microseconds> latest = {};  ///< latest time
    std::optional<Frame> first_frame = {};    ///< format only: its pixels are no longer valid
    UsedPixels used = {};
    bool is_sampled = false;  ///< `used` covers at least one interval
  };

  /// Events are sampled in intervals of this length.
  explicit RecordingSurvey(Microseconds sample_length) : sample_length_(sample_length) {}

  /// Pull mode: reads the start of a file, up to 16 MiB or 4 million events, and holds its items.
  /// Looks for streams that begin later by the index of the file or, without one, by reading on
  /// until there are events. False if bytes cannot be read.
  bool read(RecordingInput& input);

  /// True if read() read more than the items that it holds.
  bool has_moved() const { return has_moved_; }

  /// Push mode: takes the next item.
  void take(const Item& item) {
    std::visit([this](const auto& some) { note(some); }, item);
  }

  /// Push mode: declares the end of the items.
  void finish(const Decoder& decoder);

  /// True if enough is known to begin: the first time of every stream, and enough events to guess
  /// unknown sensor sizes.
  bool is_origin_known(const RecordingInput& input);

  /// Earliest time of all streams.
  std::optional<Microseconds> origin() const;

  /// Duration of the file, if known: stored in it, measured or estimated.
  std::optional<Microseconds> duration() const { return duration_; }
  bool is_duration_exact() const { return duration_is_exact_; }

  /// What is known of a stream.
  const Stream& stream(std::size_t index) { return at(index); }

  /// Takes the first item of a stream that begins later.
  void take_late(const EventItem& item) { at(item.stream).used.include(item.events); }
  void take_late(const FrameItem& item) { at(item.stream).first_frame = item.frame; }

 private:
  Stream& at(std::size_t index);
  std::optional<Item> next(RecordingInput& input);
  bool is_enough(RecordingInput& input);
  bool find_first_items(RecordingInput& input);
  void note(const EventItem& item);
  void note(const FrameItem& item);
  void note(const TriggerItem& /*item*/) {}
  void note(const ImuItem& /*item*/) {}
  void finish_short_streams(const Decoder& decoder);
  void finish(std::size_t index);
  void learn_duration(std::optional<Microseconds> stated, bool is_whole,
                      const RecordingInput& input);

  Microseconds sample_length_;
  std::vector<Stream> streams_;
  bool has_events_ = false;
  bool has_moved_ = false;
  std::optional<Microseconds> duration_;
  bool duration_is_exact_ = false;
};

}  // namespace eventcamera
