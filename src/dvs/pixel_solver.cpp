// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/pixel_solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace eventcamera {
namespace {

constexpr double never = std::numeric_limits<double>::infinity();

/// Minimum time between two events of a pixel, microseconds: the resolution of event times.
constexpr double min_gap = 1;

/// Limit of events of a pixel in one sub-interval, including those lost in its refractory period;
/// at the limit its reference is set to its signal. A change from black to white is 35 events at
/// common thresholds.
constexpr int max_events = 512;

/// Upper bound of the random numbers that a pixel draws in a sub-interval.
constexpr std::uint64_t draws_per_sub_interval = 1 << 16;

/// Signal and noise of one pixel within a sub-interval.
struct PixelLight {
  Trajectory signal;
  double last_signal;     ///< at the end of the sub-interval
  double expected_noise;  ///< 1/noise_unit
};

/// One pixel in one sub-interval. Times are microseconds after its start.
class Pixel {
 public:
  Pixel(const DvsSettings& settings, const Delays& delays, const Random& random,
        const SubInterval& sub_interval, const PixelRow& pixels, int x, const PixelLight& light,
        const BandEvents& events)
      : settings_(settings),
        delays_(delays),
        random_(random),
        sub_interval_(sub_interval),
        pixels_(pixels),
        x_(x),
        number_(pixels.first_number + static_cast<std::uint64_t>(x)),
        draw_(sub_interval.number * draws_per_sub_interval),
        events_(events),
        above_leak_(light.signal),
        reference_(pixels.reference[x]),
        positive_(pixels.positive[x]),
        negative_(pixels.negative[x]),
        leak_(pixels.leak[x] + sub_interval.rise / sub_interval.duration),
        ready_(pixels.refractory_left[x]),
        released_(ready_),
        held_(settings.refractory_reset == RefractoryReset::signal && ready_ > 0),
        expected_noise_(light.expected_noise),
        noise_budget_(pixels.noise_budget[x]) {
    // A falling reference is equivalent to a rising signal.
    above_leak_.slope += leak_;
    end_ = {sub_interval.duration, light.last_signal + leak_ * sub_interval.duration};
  }

  void solve() {
    const Crossings crossings(above_leak_, end_);
    TrajectoryPoint now{0, above_leak_.offset + above_leak_.lag};
    int happened = 0;
    for (; happened < max_events; ++happened) {
      if (held_) {
        if (released_ > end_.t) break;
        now = at(released_);
        reference_ = now.value;
        held_ = false;
      }
      const double noise = next_noise();
      const auto crossing = crossings.first(reference_ - negative_, reference_ + positive_, now);
      if (noise <= (crossing ? crossing->point.t : end_.t)) {
        if (noise > now.t) now = at(noise);
        make_noise(now, noise);
      } else if (crossing) {
        now = crossing->point;
        cross(*crossing);
      } else {
        break;
      }
    }
    if (happened == max_events) reference_ = end_.value;
    skip_noise();
    store();
  }

  /// solve() for a linear signal and events that are crossings without side effects.
  void solve_straight() {
    const bool rises = above_leak_.slope > 0;
    const double step = rises ? positive_ : -negative_;
    const double last = end_.value + (rises ? rounding : -rounding);
    int happened = 0;
    for (; happened < max_events; ++happened) {
      const double level = reference_ + step;
      if (rises ? level > last : level < last) break;
      reference_ = level;
      const double t = std::clamp((level - above_leak_.offset) / above_leak_.slope, 0.0, end_.t);
      if (t < ready_) continue;
      events_.add(sub_interval_.begin + t, x_, pixels_.y, rises ? Polarity::on : Polarity::off);
      ready_ = t + std::max(delays_.refractory_period, min_gap);
    }
    if (happened == max_events) reference_ = end_.value;
    store();
  }

  bool is_straight() const { return above_leak_.lag == 0 && above_leak_.slope != 0; }

  /// solve() for events that are crossings without side effects.
  void solve_curved() {
    const Crossings crossings(above_leak_, end_);
    TrajectoryPoint now{0, above_leak_.offset + above_leak_.lag};
    int happened = 0;
    for (; happened < max_events; ++happened) {
      const auto crossing = crossings.first(reference_ - negative_, reference_ + positive_, now);
      if (!crossing) break;
      now = crossing->point;
      reference_ += crossing->polarity == Polarity::on ? positive_ : -negative_;
      if (now.t < ready_) continue;
      events_.add(sub_interval_.begin + now.t, x_, pixels_.y, crossing->polarity);
      ready_ = now.t + std::max(delays_.refractory_period, min_gap);
    }
    if (happened == max_events) reference_ = end_.value;
    store();
  }

  /// solve() for a single noise event; returns false, without effect, if more may happen. Events
  /// must not change the thresholds.
  bool solve_lone_noise() {
    const double t = next_noise();
    if (held_ || t < ready_ || t > end_.t) return false;
    const double first = above_leak_.offset + above_leak_.lag;
    const double max_move = std::abs(above_leak_.slope) * end_.t + std::abs(above_leak_.lag) +
                            2 * static_cast<double>(rounding);
    if (first + max_move >= reference_ + positive_ || first - max_move <= reference_ - negative_ ||
        max_move >= std::min(positive_, negative_))
      return false;
    const auto next_budget = draw_noise_budget(random_, number_, Random::Purpose::event, draw_);
    if (noise_budget_ + next_budget <= expected_noise_) return false;
    ++draw_;
    passed_noise_ = noise_budget_;
    noise_budget_ = next_budget;
    fire_noise(above_leak_.at(t), t);
    store();
    return true;
  }

 private:
  /// Time of the next shot noise event; `never` if not within this sub-interval.
  double next_noise() const {
    const double then = passed_noise_ + noise_budget_;
    if (expected_noise_ < 1 || then > expected_noise_) return never;
    return sub_interval_.duration * (then / expected_noise_);
  }

  TrajectoryPoint at(double t) const { return {t, above_leak_.at(t)}; }

  void draw_noise() {
    passed_noise_ += noise_budget_;
    noise_budget_ = draw_noise_budget(random_, number_, Random::Purpose::event, draw_++);
  }

  /// `now` is at `t` or later.
  void make_noise(TrajectoryPoint now, double t) {
    draw_noise();
    if (t >= ready_) fire_noise(now.value, t);
  }

  /// Fires a noise event at this value of the signal.
  void fire_noise(double value, double t) {
    const bool is_on = (random_.bits(number_, Random::Purpose::event, draw_++) >> 63) != 0;
    reference_ = value;
    fire(t, is_on ? Polarity::on : Polarity::off);
  }

  void cross(const Crossing& crossing) {
    reference_ += crossing.polarity == Polarity::on ? positive_ : -negative_;
    if (crossing.point.t >= ready_) fire(crossing.point.t, crossing.polarity);
  }

  /// Emits an event and starts the refractory period.
  void fire(double crossed, Polarity polarity) {
    double t = crossed + delays_.latency;
    if (delays_.latency_jitter > 0) {
      const double jitter = random_.normal(number_, Random::Purpose::event, draw_++);
      t = std::max(crossed, t + delays_.latency_jitter * jitter);
    }
    if (!std::isinf(positive_)) events_.add(sub_interval_.begin + t, x_, pixels_.y, polarity);
    released_ = t + delays_.refractory_period;
    ready_ = std::max(released_, t + min_gap);
    held_ = settings_.refractory_reset == RefractoryReset::signal;
    if (settings_.threshold_jitter > 0 && !std::isinf(positive_)) {
      const Mismatch mismatch(settings_, random_);
      positive_ = mismatch.next_threshold(number_, Polarity::on, draw_++);
      negative_ = mismatch.next_threshold(number_, Polarity::off, draw_++);
    }
  }

  /// Drops noise that is due while the pixel is held or after max_events, and draws the next. Noise
  /// has no memory, so its new budget starts at the end of the sub-interval.
  void skip_noise() {
    if (expected_noise_ < 1 || passed_noise_ + noise_budget_ > expected_noise_) return;
    draw_noise();
    passed_noise_ = expected_noise_;
  }

  void store() {
    // Relative to the signal at the start of the next sub-interval.
    pixels_.reference[x_] = static_cast<float>(reference_ - leak_ * end_.t);
    pixels_.positive[x_] = static_cast<float>(positive_);
    pixels_.negative[x_] = static_cast<float>(negative_);
    const double left = (held_ ? released_ : ready_) - end_.t;
    pixels_.refractory_left[x_] = static_cast<float>(std::max(0.0, left));
    pixels_.noise_budget[x_] = static_cast<std::uint32_t>(
        std::clamp(noise_budget_ - (expected_noise_ - passed_noise_), 1.0, 4294967294.0));
  }

  const DvsSettings& settings_;
  const Delays& delays_;
  const Random& random_;
  const SubInterval& sub_interval_;
  const PixelRow& pixels_;
  int x_;
  std::uint64_t number_;
  std::uint64_t draw_;
  const BandEvents& events_;

  Trajectory above_leak_;  ///< the signal relative to a reference without leak
  TrajectoryPoint end_{};
  double reference_;
  double positive_;
  double negative_;
  double leak_;      ///< fall of the reference per microsecond
  double ready_;     ///< earliest time of the next event
  double released_;  ///< end of the refractory period
  bool held_;        ///< in reset until released_
  double expected_noise_;
  double passed_noise_ = 0;
  double noise_budget_;
};

}  // namespace

PixelSolver::PixelSolver(const DvsSettings& settings, const Random& random,
                         const SubInterval& sub_interval)
    : settings_(settings),
      random_(random),
      sub_interval_(sub_interval),
      delays_{in_microseconds(settings.refractory_period), in_microseconds(settings.latency),
              in_microseconds(settings.latency_jitter)},
      only_crossings_(settings.latency == 0 && settings.latency_jitter == 0 &&
                      settings.threshold_jitter == 0 &&
                      settings.refractory_reset == RefractoryReset::level) {}

void PixelSolver::solve(const PixelRow& pixels, const Candidates& candidates,
                        const ShadeTables& tables, const BandEvents& events) const {
  const auto pixel_of = [&](const Candidate& candidate) {
    const int x = candidate.x;
    const auto shade = static_cast<std::size_t>(candidate.shade);
    const double target = pixels.target[x];
    const auto signal =
        settings_.cutoff_hz > 0
            ? Trajectory::low_pass(candidate.last_signal, candidate.last_target, target,
                                   sub_interval_.duration, tables.bandwidth[shade])
            : Trajectory::line(candidate.last_target, target, sub_interval_.duration);
    return Pixel(settings_, delays_, random_, sub_interval_, pixels, x,
                 {signal, pixels.signal[x], tables.expected_noise[shade]}, events);
  };
  if (!only_crossings_) {
    for (const auto& candidate : candidates.without_noise) pixel_of(candidate).solve();
    for (const auto& candidate : candidates.with_noise) pixel_of(candidate).solve();
    return;
  }
  for (const auto& candidate : candidates.without_noise) {
    auto pixel = pixel_of(candidate);
    if (pixel.is_straight())
      pixel.solve_straight();
    else
      pixel.solve_curved();
  }
  for (const auto& candidate : candidates.with_noise)
    if (!pixel_of(candidate).solve_lone_noise()) pixel_of(candidate).solve();
}

}  // namespace eventcamera
