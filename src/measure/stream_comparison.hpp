// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/event_validator.hpp"
#include "src/core/image.hpp"
#include "src/measure/event_statistics.hpp"

namespace eventcamera {

/// The two streams of a comparison.
enum class StreamRole : std::uint8_t { reference, candidate };

inline constexpr std::array both_roles = {StreamRole::reference, StreamRole::candidate};

constexpr StreamRole other(StreamRole role) {
  return role == StreamRole::reference ? StreamRole::candidate : StreamRole::reference;
}

/// One of something for each of the two streams.
template <class Type>
class PerRole {
 public:
  PerRole() = default;
  PerRole(const Type& reference, const Type& candidate) : both_{reference, candidate} {}

  Type& operator[](StreamRole role) { return both_[static_cast<std::size_t>(role)]; }
  const Type& operator[](StreamRole role) const { return both_[static_cast<std::size_t>(role)]; }

 private:
  std::array<Type, 2> both_{};
};

/// Event counts of both streams in time bins of one length. The first bin has a millisecond; bins
/// are joined in pairs whenever there are too many, so that a day has as many as a second.
class RateCurve {
 public:
  using Bin = PerRole<std::uint64_t>;
  static constexpr std::size_t max_bins = 1024;

  explicit RateCurve(Microseconds start = 0) : start_(start), covered_(start) {}

  /// Takes an event after the start, and after `end` of the last extend_to().
  void add(StreamRole role, Microseconds time) {
    if (time > covered_) extend_to(time);
    ++bins_.back()[role];
  }

  /// Adds empty bins up to `end`.
  void extend_to(Microseconds end);

  Microseconds bin_length() const { return length_; }
  /// The first begins at the start.
  std::span<const Bin> bins() const { return bins_; }

 private:
  /// Of time after the start: (start, start + length] is bin 0.
  std::size_t bin_of(Microseconds time) const {
    return static_cast<std::size_t>((time - start_ - 1) / length_);
  }
  void join_bins();

  Microseconds start_;
  Microseconds covered_;  ///< where the last bin ends
  Microseconds length_ = 1000;
  std::vector<Bin> bins_;
};

/// How far apart in time matching events may be, from near to far.
inline constexpr std::array<Microseconds, 3> match_distances = {1'000, 5'000, 10'000};

/// The number of events that have a match within each of match_distances.
using MatchCounts = std::array<std::uint64_t, match_distances.size()>;

/// Counts the events of each stream that have a match: an event of the other stream with the same
/// polarity, at the same pixel or one of the eight around it, not too far away in time. Several
/// events may match the same one.
///
/// What came before an event is known when it comes: each pixel remembers its last event of either
/// polarity. For what comes after it, an event without a near enough match waits at its pixel until
/// one comes, or can come no more.
class EventMatcher {
 public:
  /// Throws std::bad_alloc, as does add().
  EventMatcher(int width, int height);

  /// Takes an event inside the picture, not before the last one of either stream.
  void add(StreamRole role, const AbsoluteEvent& event);

  /// Counts of the events so far, matched with those so far.
  const MatchCounts& matched(StreamRole role) const { return streams_[role].matched; }

 private:
  using Number = std::uint64_t;  ///< of waiting events, in the order of time; 0 = none
  static constexpr std::size_t max_waiting = std::size_t{1} << 23;

  struct Pixel {
    Microseconds last;  ///< event
    Number waiting;     ///< the last one to wait here
  };
  struct Waiting {
    Microseconds time;
    Microseconds nearest;  ///< distance of the nearest match
    Number before;         ///< the one that waited at the same pixel before
  };
  struct Stream {
    std::array<Image<Pixel>, 2> pixels;  ///< by polarity, with a margin of one
    std::deque<Waiting> waiting;
    Number first = 1;  ///< in `waiting`
    MatchCounts matched{};
  };

  static void count(Stream& stream, Microseconds distance, Microseconds known_distance);
  static void match_waiting(Stream& stream, Pixel& pixel, Microseconds time);
  static void wait(Stream& stream, Pixel& pixel, const Waiting& waiting);

  PerRole<Stream> streams_;
};

/// How alike two streams are.
struct ComparisonFigures {
  Nanoseconds start = 0;  ///< of the time that both streams cover
  Nanoseconds end = 0;
  PerRole<StreamFigures> streams;
  double map_correlation = 0;  ///< of the events of each pixel
  /// Of the events of each stream, those that have a match in the other.
  PerRole<std::array<double, match_distances.size()>> match_shares;
};

/// Compares two streams of one sensor over the time that both cover.
class StreamComparison {
 public:
  /// Throws std::bad_alloc, as does add().
  StreamComparison(int width, int height);

  /// The stream that is known less far: whose events must come next.
  StreamRole behind() const;

  /// Takes the sorted events of (start, end] of one stream, which count their times from `start`.
  /// Returns how many were skipped since they lie outside the picture.
  std::size_t add(StreamRole role, std::span<const Event> events, Nanoseconds start,
                  Nanoseconds end);

  ComparisonFigures figures() const;
  const EventMap& map(StreamRole role) const { return statistics_[role].map(); }
  const RateCurve& rates() const { return rates_; }

 private:
  struct Arriving {
    EventValidator validator;
    std::vector<AbsoluteEvent> waiting{};  ///< for the other stream
    std::size_t taken = 0;                 ///< of those, the first ones
    std::optional<Nanoseconds> start{};
    Nanoseconds end = 0;
  };

  /// What both streams cover, where they do.
  std::optional<Nanoseconds> start() const;
  Nanoseconds end() const;
  /// Takes the waiting events up to `end`, of both streams in the order of time.
  void take_until(Microseconds end);

  PerRole<Arriving> arriving_;
  PerRole<EventStatistics> statistics_;
  EventMatcher matcher_;
  RateCurve rates_;
  bool begun_ = false;
};

}  // namespace eventcamera
