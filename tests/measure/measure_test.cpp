// SPDX-License-Identifier: LGPL-2.1-or-later
// Compares measurements of streams to the same values computed from all events at once.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "src/measure/event_statistics.hpp"
#include "src/measure/stream_comparison.hpp"
#include "src/render/rgb_picture.hpp"

namespace {

using namespace eventcamera;

struct Extent {
  int width;
  int height;
};

using Stream = std::vector<AbsoluteEvent>;

/// Sorted random events in [start, end]; some times are equal.
Stream stream_by_chance(Extent extent, std::size_t count, Microseconds start, Microseconds end,
                        unsigned seed) {
  std::mt19937 random(seed);
  const auto between = [&](std::int64_t first, std::int64_t last) {
    return std::uniform_int_distribution<std::int64_t>(first, last)(random);
  };
  Stream stream;
  for (std::size_t i = 0; i < count; ++i)
    stream.push_back(AbsoluteEvent::at(static_cast<int>(between(0, extent.width - 1)),
                                       static_cast<int>(between(0, extent.height - 1)),
                                       between(start, end),
                                       between(0, 2) == 0 ? Polarity::off : Polarity::on));
  std::ranges::sort(stream, {}, &AbsoluteEvent::t);
  return stream;
}

/// Passes a stream in buffers of random length, with boundaries at whole microseconds.
class Feed {
 public:
  Feed(StreamRole role, const Stream& stream, Microseconds start, Microseconds end, unsigned seed)
      : role_(role), stream_(stream), at_(start), end_(end), random_(seed) {}

  bool done() const { return at_ >= end_; }

  void next(StreamComparison& comparison) {
    const auto until = std::min(
        end_, at_ + std::uniform_int_distribution<Microseconds>(1, (end_ - at_) / 4 + 2)(random_));
    std::vector<Event> events;
    for (; taken_ < stream_.size() && stream_[taken_].t <= until; ++taken_)
      events.push_back({static_cast<std::uint32_t>(stream_[taken_].t - at_), stream_[taken_].x,
                        stream_[taken_].y_p});
    EXPECT_EQ(comparison.add(role_, events, at_, at_ * 1000, until * 1000), InvalidEvents{});
    at_ = until;
  }

 private:
  StreamRole role_;
  const Stream& stream_;
  std::size_t taken_ = 0;
  Microseconds at_;
  Microseconds end_;
  std::mt19937 random_;
};

MatchFigures matches_plainly(const Stream& of, const Stream& among) {
  MatchFigures figures;
  if (of.empty()) return figures;
  const auto events = static_cast<double>(of.size());
  for (const auto& event : of) {
    Microseconds nearest = match_distances.back() + 1;
    for (const auto& match : among)
      if (match.polarity() == event.polarity() && std::abs(match.x - event.x) <= 1 &&
          std::abs(match.y() - event.y()) <= 1)
        nearest = std::min(nearest, std::abs(match.t - event.t));
    for (std::size_t i = 0; i < match_distances.size(); ++i)
      figures.shares[i] += nearest <= match_distances[i] ? 1 / events : 0;
    figures.nearest_distance +=
        static_cast<double>(std::min(nearest, match_distances.back())) / events;
  }
  return figures;
}

std::vector<double> map_plainly(Extent extent, const Stream& stream) {
  std::vector<double> map(static_cast<std::size_t>(extent.width * extent.height));
  for (const auto& event : stream)
    ++map[static_cast<std::size_t>(event.y() * extent.width + event.x)];
  return map;
}

double mean_plainly(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double covariance_plainly(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += (a[i] - mean_plainly(a)) * (b[i] - mean_plainly(b));
  return sum / static_cast<double>(a.size());
}

double correlation_plainly(const std::vector<double>& a, const std::vector<double>& b) {
  const double variances = covariance_plainly(a, a) * covariance_plainly(b, b);
  return variances > 0 ? covariance_plainly(a, b) / std::sqrt(variances) : 0;
}

/// Number of events in each millisecond from `start`.
std::vector<double> rates_plainly(const Stream& stream, Microseconds start, std::size_t bins) {
  std::vector<double> rates(bins);
  for (const auto& event : stream) ++rates[static_cast<std::size_t>((event.t - start) / 1000)];
  return rates;
}

/// Times between the successive events of a pixel, sorted.
std::vector<Microseconds> intervals_plainly(const Stream& stream) {
  std::map<std::pair<int, int>, Microseconds> last;
  std::vector<Microseconds> intervals;
  for (const auto& event : stream) {
    const auto [place, first] = last.try_emplace({event.x, event.y()}, event.t);
    if (!first) intervals.push_back(event.t - std::exchange(place->second, event.t));
  }
  std::ranges::sort(intervals);
  return intervals;
}

/// Mean distance between quantiles, at every share that both have.
double distance_plainly(const std::vector<Microseconds>& a, const std::vector<Microseconds>& b) {
  double sum = 0;
  const auto logarithm = [](Microseconds interval) {
    return std::log10(std::max(static_cast<double>(interval), 0.5));
  };
  for (std::size_t i = 0; i < a.size() * b.size(); ++i)
    sum += std::abs(logarithm(a[i / b.size()]) - logarithm(b[i / a.size()]));
  return a.empty() || b.empty() ? 0 : sum / static_cast<double>(a.size() * b.size());
}

void expect_figures(const StreamFigures& figures, Extent extent, const Stream& stream,
                    double seconds) {
  const auto map = map_plainly(extent, stream);
  EXPECT_EQ(figures.events, stream.size());
  EXPECT_NEAR(figures.rate, static_cast<double>(stream.size()) / seconds, 1e-6);
  EXPECT_NEAR(figures.mean, mean_plainly(map) / seconds, 1e-9);
  EXPECT_NEAR(figures.std_dev, std::sqrt(covariance_plainly(map, map)) / seconds, 1e-6);
  const auto on = std::ranges::count(stream, Polarity::on, &AbsoluteEvent::polarity);
  EXPECT_NEAR(figures.on_share,
              stream.empty() ? 0 : static_cast<double>(on) / static_cast<double>(stream.size()),
              1e-12);

  const auto active = std::ranges::count_if(map, [](double count) { return count > 0; });
  EXPECT_NEAR(figures.active_share, static_cast<double>(active) / static_cast<double>(map.size()),
              1e-12);
  std::set<Microseconds> times;
  for (const auto& event : stream) times.insert(event.t);
  EXPECT_NEAR(
      figures.distinct_share,
      stream.empty() ? 0 : static_cast<double>(times.size()) / static_cast<double>(stream.size()),
      1e-12);

  const auto intervals = intervals_plainly(stream);
  for (std::size_t i = 0; i < interval_shares.size(); ++i) {
    const auto rank = static_cast<std::size_t>(
        std::ceil(interval_shares[i] * static_cast<double>(intervals.size())));
    const auto expected = intervals.empty() ? 0 : intervals[std::max<std::size_t>(rank, 1) - 1];
    EXPECT_NEAR(static_cast<double>(figures.intervals[i]), static_cast<double>(expected),
                static_cast<double>(expected) / 32);
  }
}

void expect_matches(const MatchFigures& figures, const MatchFigures& expected) {
  for (std::size_t i = 0; i < match_distances.size(); ++i)
    EXPECT_NEAR(figures.shares[i], expected.shares[i], 1e-9);
  EXPECT_NEAR(figures.nearest_distance, expected.nearest_distance, 1e-6);
}

void expect_ceiling(const CeilingFigures& figures, const Stream& stream, Microseconds start,
                    std::size_t bins) {
  std::array<Stream, 2> halves;
  std::mt19937 random;
  for (const auto& event : stream) halves[random() % 2].push_back(event);
  const auto& [a, b] = halves;
  const auto of_wholes = [](double r) { return r < 0 ? 0 : 2 * r / (1 + r); };
  EXPECT_NEAR(
      figures.rate_correlation,
      of_wholes(correlation_plainly(rates_plainly(a, start, bins), rates_plainly(b, start, bins))),
      1e-9);
  EXPECT_NEAR(figures.interval_distance,
              distance_plainly(intervals_plainly(a), intervals_plainly(b)), 0.02);
  const auto first = matches_plainly(a, b);
  const auto second = matches_plainly(b, a);
  MatchFigures expected{.nearest_distance = (first.nearest_distance + second.nearest_distance) / 4};
  for (std::size_t i = 0; i < match_distances.size(); ++i)
    expected.shares[i] = 1 - std::pow(1 - (first.shares[i] + second.shares[i]) / 2, 2);
  expect_matches(figures.matches, expected);
}

TEST(IntervalHistogram, IsExactBelow64AndToAThirtySecondBeyond) {
  EXPECT_EQ(IntervalHistogram().quantile(0.5), 0);
  for (Microseconds interval = 0; interval < 64; ++interval) {
    IntervalHistogram intervals;
    intervals.add(interval);
    EXPECT_EQ(intervals.quantile(0.5), interval);
  }
  for (Microseconds interval = 64; interval < INT64_MAX / 3; interval += interval / 7) {
    IntervalHistogram intervals;
    intervals.add(interval);
    EXPECT_NEAR(static_cast<double>(intervals.quantile(1)), static_cast<double>(interval),
                static_cast<double>(interval) / 32);
  }
  IntervalHistogram intervals;
  intervals.add(INT64_MAX);
  EXPECT_GT(intervals.quantile(1), INT64_MAX / 33 * 32);
}

TEST(LastTimes, AreForgotten) {
  LastTimes times(3, 2);
  const auto interval_at = [&times](Microseconds t) {
    return times.update(AbsoluteEvent::at(2, 1, t, Polarity::on));
  };
  EXPECT_EQ(interval_at(-5), std::nullopt);
  EXPECT_EQ(interval_at(0), 5);
  EXPECT_EQ(interval_at(0), 0);
  EXPECT_EQ(interval_at(30), 30);
  EXPECT_EQ(times.update(AbsoluteEvent::at(1, 1, 40, Polarity::on)), std::nullopt);
  times.forget();
  EXPECT_EQ(interval_at(20), std::nullopt);
}

TEST(EventStatistics, Restarts) {
  EventStatistics statistics(3, 2);
  statistics.add(AbsoluteEvent::at(2, 1, 100, Polarity::on), 7);
  statistics.restart();
  statistics.add(AbsoluteEvent::at(2, 1, 130, Polarity::off), 30);
  const auto figures = statistics.figures(1'000'000'000);
  EXPECT_EQ(figures.events, 1U);
  EXPECT_EQ(figures.on_share, 0);
  EXPECT_EQ(figures.intervals[0], 30);
  EXPECT_EQ(statistics.map().at(2, 1), 1U);
}

TEST(RateCurve, JoinsBinsWhenThereAreTooMany) {
  RateCurve curve(500);
  curve.add(StreamRole::reference, 500);
  curve.add(StreamRole::reference, 1499);
  curve.add(StreamRole::candidate, 1500);
  ASSERT_EQ(curve.bins().size(), 2U);
  EXPECT_EQ(curve.bins()[0][StreamRole::reference], 2U);
  EXPECT_EQ(curve.bins()[1][StreamRole::candidate], 1U);
  curve.extend_to(500 + 1000 * static_cast<Microseconds>(RateCurve::max_bins));
  EXPECT_EQ(curve.bins().size(), RateCurve::max_bins);
  EXPECT_EQ(curve.bin_length(), 1000);
  curve.add(StreamRole::candidate, 500 + 1000 * static_cast<Microseconds>(RateCurve::max_bins));
  EXPECT_EQ(curve.bin_length(), 2000);
  EXPECT_EQ(curve.bins().size(), RateCurve::max_bins / 2 + 1);
  EXPECT_EQ(curve.bins()[0][StreamRole::reference], 2U);
  EXPECT_EQ(curve.bins()[0][StreamRole::candidate], 1U);
  curve.extend_to(Microseconds{1} << 55);
  EXPECT_LE(curve.bins().size(), RateCurve::max_bins);
  std::uint64_t sum = 0;
  for (const auto& bin : curve.bins())
    sum += bin[StreamRole::reference] + bin[StreamRole::candidate];
  EXPECT_EQ(sum, 4U);
}

struct Scene {
  Extent extent;
  std::size_t reference;
  std::size_t candidate;
  Microseconds reference_start;
  Microseconds candidate_start;
};

class ComparisonTest : public testing::TestWithParam<std::tuple<Scene, unsigned>> {};

TEST_P(ComparisonTest, IsThatOfAllEventsAtOnce) {
  const auto& [scene, seed] = GetParam();
  constexpr Microseconds reference_end = 150'000;
  constexpr Microseconds candidate_end = 170'000;
  const auto reference =
      stream_by_chance(scene.extent, scene.reference, scene.reference_start, reference_end, seed);
  const auto candidate = stream_by_chance(scene.extent, scene.candidate, scene.candidate_start,
                                          candidate_end, seed + 100);
  StreamComparison comparison(scene.extent.width, scene.extent.height);
  Feed feed_reference(StreamRole::reference, reference, scene.reference_start, reference_end, seed);
  Feed feed_candidate(StreamRole::candidate, candidate, scene.candidate_start, candidate_end, seed);
  while (true) {
    auto& feed = comparison.behind() == StreamRole::reference ? feed_reference : feed_candidate;
    if (feed.done()) break;
    feed.next(comparison);
  }

  const auto start = std::max(scene.reference_start, scene.candidate_start);
  const auto both = [&](const Stream& stream) {
    Stream covered;
    std::ranges::copy_if(stream, std::back_inserter(covered), [&](const AbsoluteEvent& event) {
      return event.t >= start && event.t <= reference_end;
    });
    return covered;
  };
  const auto covered_reference = both(reference);
  const auto covered_candidate = both(candidate);
  const auto figures = comparison.figures();
  EXPECT_EQ(figures.start, start * 1000);
  EXPECT_EQ(figures.end, reference_end * 1000);
  const double seconds = static_cast<double>(reference_end - start) / 1e6;
  expect_figures(figures.streams[StreamRole::reference], scene.extent, covered_reference, seconds);
  expect_figures(figures.streams[StreamRole::candidate], scene.extent, covered_candidate, seconds);

  const auto a = map_plainly(scene.extent, covered_reference);
  const auto b = map_plainly(scene.extent, covered_candidate);
  EXPECT_NEAR(figures.similarity.map_correlation, correlation_plainly(a, b), 1e-9);
  EXPECT_NEAR(
      figures.similarity.interval_distance,
      distance_plainly(intervals_plainly(covered_reference), intervals_plainly(covered_candidate)),
      0.02);

  expect_matches(figures.similarity.matches[StreamRole::reference],
                 matches_plainly(covered_reference, covered_candidate));
  expect_matches(figures.similarity.matches[StreamRole::candidate],
                 matches_plainly(covered_candidate, covered_reference));

  const auto& curve = comparison.rates();
  const auto bins = curve.bins().size();
  EXPECT_NEAR(figures.similarity.rate_correlation,
              correlation_plainly(rates_plainly(covered_reference, start, bins),
                                  rates_plainly(covered_candidate, start, bins)),
              1e-9);
  expect_ceiling(figures.ceiling, covered_reference, start, bins);

  const auto whole = static_cast<std::size_t>((reference_end - start + 999) / 1000);
  EXPECT_GE(curve.bins().size(), whole);
  EXPECT_LE(curve.bins().size(), whole + 1);  // events at the end
}

INSTANTIATE_TEST_SUITE_P(Streams, ComparisonTest,
                         testing::Combine(testing::Values(Scene{{7, 5}, 600, 500, 0, 0},       //
                                                          Scene{{31, 17}, 1500, 1700, 0, 0},   //
                                                          Scene{{1, 1}, 300, 40, 0, 0},        //
                                                          Scene{{1, 9}, 300, 300, 20'000, 0},  //
                                                          Scene{{13, 3}, 400, 400, 0, 33'333},
                                                          Scene{{5, 5}, 0, 300, 0, 0},  //
                                                          Scene{{5, 5}, 300, 0, 0, 0},  //
                                                          Scene{{5, 5}, 0, 0, 0, 10}),
                                          testing::Values(1U, 2U, 3U)));

TEST(Comparison, HasNothingToSayOfStreamsThatDoNotMeet) {
  StreamComparison comparison(4, 4);
  EXPECT_EQ(comparison.behind(), StreamRole::reference);
  EXPECT_EQ(comparison.figures().end, 0);
  const std::vector events = {Event::at(1, 1, 5, Polarity::on)};
  comparison.add(StreamRole::reference, events, 0, 0, 1'000'000);
  EXPECT_EQ(comparison.behind(), StreamRole::candidate);
  comparison.add(StreamRole::candidate, events, 5'000, 5'000'000, 6'000'000);
  EXPECT_EQ(comparison.behind(), StreamRole::reference);
  const auto figures = comparison.figures();
  EXPECT_EQ(figures.streams[StreamRole::reference].events, 0U);
  EXPECT_EQ(figures.streams[StreamRole::candidate].events, 0U);
}

TEST(Comparison, CountsCausesInTheCommonTimeOnly) {
  StreamComparison comparison(4, 4);
  std::vector<Event> events;
  for (std::uint32_t t = 500; t < 20'000; t += 1000)
    events.push_back(Event::at(1, 1, t, Polarity::on));
  const std::vector<Label> light(events.size(), {.cause = Cause::light});
  comparison.add(StreamRole::reference, events, 0, 0, 20'000'000, light);
  EXPECT_EQ(comparison.causes(StreamRole::reference).all(), 0U);
  comparison.add(StreamRole::candidate, std::span(events).first(10), 5'000, 5'000'000, 15'000'000,
                 std::span(light).first(10));
  for (const auto role : both_roles) {
    EXPECT_EQ(comparison.causes(role)[Cause::light], 10U);
    EXPECT_EQ(comparison.causes(role).all(), 10U);
  }
  comparison.add(StreamRole::candidate, std::span(events).first(10), 20'000, 20'000'000,
                 30'000'000);
  EXPECT_EQ(comparison.causes(StreamRole::reference).all(), 15U);
}

TEST(Comparison, SurvivesEventsBeyondThePictureAndOutOfOrder) {
  StreamComparison comparison(4, 4);
  const std::vector events = {Event::at(4, 0, 5, Polarity::on), Event::at(0, 4, 5, Polarity::on),
                              Event::at(3, 3, 900, Polarity::on), Event::at(0, 0, 2, Polarity::on),
                              Event::at(0, 0, 4'000'000'000, Polarity::on)};
  for (const auto role : both_roles) {
    const InvalidEvents invalid{.outside = 2, .unsorted = 1};
    EXPECT_EQ(comparison.add(role, events, 1'000, 1'000'000, 2'000'000), invalid);
    EXPECT_EQ(comparison.add(role, events, 0, 0, 1'000'000), invalid);
    EXPECT_EQ(comparison.add(role, events, -5'000, -5'000'000, 9'000'000), invalid);
  }
  const auto figures = comparison.figures();
  EXPECT_EQ(figures.streams[StreamRole::reference].events,
            figures.streams[StreamRole::candidate].events);
  EXPECT_EQ(figures.similarity.matches[StreamRole::candidate].shares[0], 1);
}

TEST(MapPicture, ShowsMoreEventsBrighterAndSaysWhatCannotBeWritten) {
  EventMap few(3, 2);
  EventMap many(3, 2);
  few.at(0, 0) = 1;
  many.at(2, 1) = 9;
  const auto alone = draw_map(few);
  EXPECT_EQ(alone.width(), 3);
  EXPECT_EQ(alone.height(), 2 + 8);  // with the bar
  EXPECT_GT(alone.row(0)[0], 200);
  EXPECT_LT(alone.row(0)[3], 10);
  const auto pair = draw_maps(few, many);
  EXPECT_EQ(pair.width(), 9);
  const auto colour = [&](int x, int y) {
    const auto* at = pair.row(y) + std::ptrdiff_t{3} * x;
    return std::vector<int>(at, at + 3);
  };
  EXPECT_EQ(colour(7, 1), (std::vector{255, 255, 255}));
  EXPECT_EQ(colour(8, 1), (std::vector{32, 64, 224}));
  EXPECT_GT(colour(6, 0)[0], colour(6, 0)[2]);
  EXPECT_EQ(pair.png().substr(1, 3), "PNG");
}

}  // namespace
