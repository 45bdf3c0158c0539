// SPDX-License-Identifier: LGPL-2.1-or-later
// The solvers of the physical pixel, and the functions that they are made of, on every SIMD target.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>

#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/elementary.hpp"
#include "src/dvs/light_response.hpp"
#include "src/dvs/pixel_array.hpp"
#include "src/dvs/pixel_solver.hpp"
#include "src/dvs/random.hpp"
#include "src/dvs/trajectory.hpp"
#include "tests/core/targets.hpp"
#include "tests/dvs/playback.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

TEST(Elementary, FunctionsAreTheirNamesakes) {
  for (double x = 1e-300; x < 1e300; x *= 1.37)
    ASSERT_NEAR(logarithm(x), std::log(x), 1e-11 * std::abs(std::log(x)) + 1e-13) << x;
  for (double x = 0; x < std::numbers::pi / 4; x += 0.001) {
    const auto [cosine, sine] = cosine_and_sine(x);
    ASSERT_NEAR(cosine, std::cos(x), 3e-8) << x;
    ASSERT_NEAR(sine, std::sin(x), 2e-9) << x;
  }
}

TEST(Random, IsNormalInTwoIndependentNumbers) {
  const Random random(3);
  constexpr int count = 200'000;
  double squares = 0;
  double fourths = 0;
  double products = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto [first, second] = random.normals(i / 4, Random::Purpose::event, i % 4);
    squares += first * first + second * second;
    fourths += std::pow(first, 4) + std::pow(second, 4);
    products += first * second;
  }
  EXPECT_NEAR(squares / (2 * count), 1, 0.015);
  EXPECT_NEAR(fourths / (2 * count), 3, 0.1);
  EXPECT_NEAR(products / count, 0, 0.01);
}

TEST(Decay, IsTheExponentialFunction) {
  for (double x = 0; x < 690; x += 0.0137 * (1 + x / 10))
    ASSERT_NEAR(decay(x) / std::exp(-x), 1, 1e-11) << x;
  EXPECT_EQ(decay(0), 1);
  EXPECT_GE(decay(1e300), 0);
  EXPECT_LT(decay(1e300), 1e-300);
}

/// First of many small steps at which a trajectory is beyond one of the two levels, or -1.
double plainly_crossed(const Trajectory& trajectory, double lower, double upper, double end) {
  constexpr int steps = 200'000;
  for (int i = 0; i <= steps; ++i) {
    const double value = trajectory.at(end * i / steps);
    if (value >= upper || value <= lower) return end * i / steps;
  }
  return -1;
}

TEST(Crossings, AreFoundOnEveryTrajectoryOfALowPass) {
  std::minstd_rand random(5);
  const auto uniform = [&](double from, double to) {
    return std::uniform_real_distribution<>(from, to)(random);
  };
  constexpr double end = 40'000;
  int found = 0;
  for (int i = 0; i < 600; ++i) {
    const double bandwidth = std::pow(10, uniform(-7, -2));
    auto trajectory =
        Trajectory::low_pass(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), end, bandwidth);
    trajectory.slope += uniform(0, 1) < 0.5 ? 0 : uniform(0, 2e-5);
    const double reference = trajectory.at(0) + uniform(-0.19, 0.19);
    const Crossings crossings(trajectory, {end, trajectory.at(end)});
    const auto first = crossings.first(reference - 0.2, reference + 0.2, {0, trajectory.at(0)});
    const double plain = plainly_crossed(trajectory, reference - 0.2, reference + 0.2, end);
    ASSERT_EQ(first.has_value(), plain >= 0) << i;
    if (!first) continue;
    ++found;
    ASSERT_NEAR(first->point.t, plain, 0.3) << i << " " << bandwidth;
    ASSERT_NEAR(trajectory.at(first->point.t), first->point.value, 1e-6) << i;
  }
  EXPECT_GT(found, 200);
}

/// Result of a solver: events by pixel, and the state of the pixels.
struct Solved {
  Pixels events;
  std::vector<float> state;
  std::vector<std::uint32_t> noise_budgets;
};

/// A row of pixels in light that changes at random, advanced through a sub-interval.
template <class Solve>
Solved solved(const DvsSettings& settings, int width, const Solve& solve) {
  const ShadeTables tables(settings, 40'000, 1);
  const SubInterval sub_interval{0, 40'000, 1, 1, 0.01, 3, 0, 0.4, &tables};
  std::minstd_rand draw(5);
  std::uniform_real_distribution<float> level(-1.4F, 0.2F);
  PixelArray array(width, 1);
  array.set_labels(true);
  LightResponse response(16);
  auto light = settings;
  light.response = Response::log;
  light.log_eps = 0.25;  // so that responses are within those levels
  response.set(light);
  ThreadPool threads;
  array.start(settings, threads);
  Image<std::uint16_t> frame(width, 1);
  std::generate_n(frame.row(0), width, [&] { return static_cast<std::uint16_t>(draw()); });
  array.settle(frame, response, threads);
  RowToSolve row;
  row.model = &array.model();
  row.pixels = array.row(0);
  row.sub_interval = &sub_interval;
  const auto& pixels = row.pixels;
  auto& candidates = row.candidates;
  candidates.resize(width);
  for (int x = 0; x < width; ++x) {
    const int shade = static_cast<int>(draw() % shades);
    const float from = pixels.target[x];
    const bool is_lagging = settings.cutoff_frequency > 0;
    const float signal = is_lagging ? from + 0.1F * (level(draw) + 0.6F) : from;
    const float to = x % 5 == 0 ? from : level(draw);
    pixels.target[x] = to;
    const double bandwidth = tables.bandwidth[static_cast<std::size_t>(shade)];
    pixels.signal[x] =
        is_lagging ? static_cast<float>(
                         Trajectory::low_pass(signal, from, to, sub_interval.duration, bandwidth)
                             .at(sub_interval.duration))
                   : to;
    if (x % 7 == 0) pixels.refractory_left[x] = 9000;
    // As where thresholds have been lowered.
    if (x % 11 == 3) pixels.reference[x] = from + (x % 2 == 0 ? 0.7F : -0.7F);
    const auto i = candidates.count++;
    candidates.x[i] = x;
    candidates.shade[i] = shade;
    const std::pair<Candidates::Column, float> values[] = {
        {Candidates::target, pixels.target[x]},
        {Candidates::signal, pixels.signal[x]},
        {Candidates::last_target, from},
        {Candidates::last_signal, signal},
        {Candidates::reference, pixels.reference[x]},
        {Candidates::positive, pixels.positive[x]},
        {Candidates::negative, pixels.negative[x]},
        {Candidates::leak, pixels.leak[x]},
        {Candidates::refractory_left, pixels.refractory_left[x]}};
    for (const auto& [column, value] : values) candidates.column(column)[i] = value;
  }
  IntervalEvents events(width, 1);
  events.begin(sub_interval.duration, 0, 0);
  row.events.begin(events, 0);
  solve(row);
  row.events.end();
  Solved result;
  StepBuckets read;
  for (const auto& event : scene::copy(events.end(read, threads))) {
    const int x = without_cause(event).x;
    result.events[{x, 0}].push_back(
        {static_cast<double>(event.t), x, 0, event.polarity(), cause_of(event)});
  }
  for (const float* values :
       {pixels.reference, pixels.positive, pixels.negative, pixels.refractory_left})
    result.state.insert(result.state.end(), values, values + width);
  result.noise_budgets.assign(pixels.noise_budget, pixels.noise_budget + width);
  return result;
}

/// Expects equal results but for rounding.
void expect_equal(const Solved& found, const Solved& expected) {
  ASSERT_EQ(found.events.size(), expected.events.size());
  for (const auto& [place, events] : expected.events) {
    const auto& ours = found.events.at(place);
    ASSERT_EQ(ours.size(), events.size()) << place.first;
    for (std::size_t i = 0; i < events.size(); ++i) {
      EXPECT_NEAR(ours[i].t, events[i].t, 1) << place.first;
      EXPECT_EQ(ours[i].polarity, events[i].polarity) << place.first;
      EXPECT_EQ(ours[i].cause, events[i].cause) << place.first;
    }
  }
  for (std::size_t i = 0; i < expected.state.size(); ++i) {
    if (std::isinf(expected.state[i]))  // a threshold of a dead pixel
      EXPECT_EQ(found.state[i], expected.state[i]) << i;
    else
      EXPECT_NEAR(found.state[i], expected.state[i], 0.01) << i;
  }
  EXPECT_EQ(found.noise_budgets, expected.noise_budgets);
}

/// Expects that find() returns this, and the same state, on every target.
template <class Find>
void expect_equal_on_all_targets(const Solved& expected, const Find& find) {
  std::optional<Solved> first;
  targets::for_each([&](const char* target) {
    SCOPED_TRACE(target);
    const Solved found = find();
    expect_equal(found, expected);
    if (!first) first = found;
    EXPECT_EQ(found.state, first->state);
  });
}

TEST(Solvers, AreEqualOnAllTargets) {
  DvsSettings settings{.threshold_sigma = 0.03,
                       .leak_rate = 5,
                       .leak_spread = 0.1,
                       .dead_pixels = 0.05,
                       .refractory_period = 700'000};
  for (const int width : {1, 3, 17, 500}) {
    for (const auto& [adaptation, jitter, noise_hz] :
         {std::array{0.0, 0.0, 0.0}, std::array{0.0, 0.0, 30.0}, std::array{0.2, 0.0, 0.0},
          std::array{2.0, 0.0, 30.0}, std::array{0.0, 0.1, 0.0}, std::array{0.3, 0.04, 30.0}}) {
      auto varying = settings;
      varying.adaptation = adaptation;
      varying.threshold_jitter = jitter;
      varying.shot_noise_rate = noise_hz;
      if (jitter > 0) varying.threshold_sigma = 0;
      ASSERT_EQ(PixelModel(varying).solver, Solver::lines);
      expect_equal_on_all_targets(solved(varying, width, solve_pixels),
                                  [&] { return solved(varying, width, solve_lines); });
    }
    auto held = settings;
    held.refractory_reset = RefractoryReset::signal;
    auto late = settings;
    late.pixel_latency = 300'000;
    auto jittery = held;
    jittery.pixel_latency = 300'000;
    jittery.pixel_latency_jitter = 100'000;
    for (const auto& base : {settings, held, late, jittery}) {
      for (const double noise_hz : {0.0, 30.0}) {
        for (const double cutoff_frequency : {0.0, 3.0, 30.0, 3000.0}) {
          auto others = base;
          others.cutoff_frequency = cutoff_frequency;
          others.shot_noise_rate = noise_hz;
          expect_equal_on_all_targets(solved(others, width, solve_pixels),
                                      [&] { return solved(others, width, solve_row); });
        }
      }
    }
  }
}

}  // namespace
