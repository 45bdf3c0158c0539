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

/// One value per stream.
template <class Type>
class PerRole {
 public:
  PerRole() = default;
  PerRole(Type reference, Type candidate) : both_{std::move(reference), std::move(candidate)} {}

  Type& operator[](StreamRole role) { return both_[static_cast<std::size_t>(role)]; }
  const Type& operator[](StreamRole role) const { return both_[static_cast<std::size_t>(role)]; }

 private:
  std::array<Type, 2> both_{};
};

/// Event counts of both streams in time bins of equal length. Bins start at a millisecond and are
/// merged in pairs whenever there are too many, so that memory does not grow with time.
class RateCurve {
 public:
  using Bin = PerRole<std::uint64_t>;
  static constexpr std::size_t max_bins = 1024;

  explicit RateCurve(Microseconds start = 0) : start_(start), covered_(start) {}

  /// Adds an event, which must not be before the start, nor before `end` of the last extend_to().
  void add(StreamRole role, Microseconds time) {
    if (time >= covered_) extend_to(time + 1);
    ++bins_.back()[role];
  }

  /// Adds empty bins up to `end`.
  void extend_to(Microseconds end);

  Microseconds bin_length() const { return length_; }
  /// The first bin begins at the start.
  std::span<const Bin> bins() const { return bins_; }

 private:
  std::size_t bin_of(Microseconds time) const {
    return static_cast<std::size_t>((time - start_) / length_);
  }
  void join_bins();

  Microseconds start_;
  Microseconds covered_;  ///< end of the last bin
  Microseconds length_ = 1000;
  std::vector<Bin> bins_;
};

/// Pearson correlation of the event counts of both streams in bins of a millisecond, in constant
/// memory.
class RateCorrelation {
 public:
  explicit RateCorrelation(Microseconds start = 0) : end_(start) {}

  /// Adds an event, which must not be before the start, nor in a bin before the last one.
  void add(StreamRole role, Microseconds time) {
    extend_to(time + 1);
    ++last_[role];
  }

  /// Adds empty bins up to `end`.
  void extend_to(Microseconds end);

  /// 0 if the counts of one stream are constant.
  double value() const;

 private:
  /// Of the counts in bins.
  struct Sums {
    double bins = 0;
    double product = 0;
    PerRole<double> counts;
    PerRole<double> squares;
  };
  static void add_bin(Sums& sums, const PerRole<double>& bin);

  Microseconds end_;  ///< of the last bin
  Sums sums_;         ///< without the last bin
  bool has_bin_ = false;
  PerRole<double> last_;  ///< the last bin
};

/// Maximum distances in time of matching events, in increasing order.
inline constexpr std::array<Microseconds, 3> match_distances = {1'000, 5'000, 10'000};

/// Numbers of events with a match within each of match_distances.
using MatchCounts = std::array<std::uint64_t, match_distances.size()>;

/// Counts the events of each stream that have a match: an event of the other stream with the same
/// polarity, at the same pixel or one of its eight neighbours, close in time. Several events may
/// match the same one.
///
/// Each pixel stores its last event of either polarity, so earlier matches are known when an event
/// is added. An event without a close enough match waits at its pixel until a later match is added,
/// or can no longer be added.
class EventMatcher {
 public:
  /// Throws std::bad_alloc, as does add().
  EventMatcher(int width, int height);

  /// Adds an event, which must lie inside the sensor and not be earlier than the last one of either
  /// stream.
  void add(StreamRole role, const AbsoluteEvent& event);

  /// Counts of matches among the events so far.
  const MatchCounts& matched(StreamRole role) const { return streams_[role].matched; }

 private:
  using Number = std::uint64_t;  ///< index of a waiting event, in order of time; 0 = none
  static constexpr std::size_t max_waiting = std::size_t{1} << 23;

  struct Pixel {
    LastTime last;
    Number waiting;  ///< latest waiting event at this pixel
  };
  struct Waiting {
    Microseconds time;
    Microseconds nearest;  ///< distance to the nearest match so far
    Number before;         ///< previous waiting event at this pixel
  };
  struct Stream {
    std::array<Image<Pixel>, 2> pixels;  ///< by polarity, with a margin of one
    std::deque<Waiting> waiting;
    Number first = 1;  ///< number of the first event in `waiting`
    MatchCounts matched{};
  };

  static void count(Stream& stream, Microseconds distance, Microseconds known_distance);
  static void match_waiting(Stream& stream, Pixel& pixel, Microseconds time);
  static void wait(Stream& stream, Pixel& pixel, const Waiting& waiting);

  PerRole<Stream> streams_;
};

/// Similarity of two streams.
struct ComparisonFigures {
  Nanoseconds start = 0;  ///< start of the time covered by both streams
  Nanoseconds end = 0;
  PerRole<StreamFigures> streams;
  double map_correlation = 0;    ///< correlation of the event counts per pixel
  double rate_correlation = 0;   ///< correlation of the event counts per millisecond
  double interval_distance = 0;  ///< between the inter-event intervals, decades
  /// Fraction of events with a match in the other stream, per stream and match distance.
  PerRole<std::array<double, match_distances.size()>> match_shares;
};

/// Compares two streams of the same sensor over the time that both cover.
class StreamComparison {
 public:
  /// Throws std::bad_alloc, as does add().
  StreamComparison(int width, int height);

  /// The stream that lags behind; its events are needed next.
  StreamRole behind() const;

  /// Adds the sorted events of [start, end] of one stream, with times relative to `start`. Returns
  /// the number of events skipped because they lie outside the sensor.
  std::size_t add(StreamRole role, std::span<const Event> events, Nanoseconds start,
                  Nanoseconds end);

  ComparisonFigures figures() const;
  const EventMap& map(StreamRole role) const { return statistics_[role].map(); }
  const RateCurve& rates() const { return rates_; }

 private:
  struct Arriving {
    EventValidator validator;
    std::vector<AbsoluteEvent> waiting{};  ///< events waiting for the other stream
    std::size_t taken = 0;  ///< number of events at the front of `waiting` already processed
    std::optional<Nanoseconds> start{};
    Nanoseconds end = 0;
  };

  /// Start of the time covered by both streams; none if they do not overlap yet.
  std::optional<Nanoseconds> start() const;
  Nanoseconds end() const;
  /// Processes the waiting events of both streams up to `end`, in order of time.
  void take_until(Microseconds end);

  PerRole<Arriving> arriving_;
  PerRole<LastTimes> last_times_;
  PerRole<EventStatistics> statistics_;
  RateCorrelation rate_correlation_;
  EventMatcher matcher_;
  RateCurve rates_;
  bool begun_ = false;
};

}  // namespace eventcamera
