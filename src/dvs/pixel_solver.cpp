// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/pixel_solver.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "src/dvs/shot_noise.hpp"
#include "src/dvs/trajectory.hpp"

namespace eventcamera {
namespace {

/// Signal and noise of one pixel within a sub-interval.
struct PixelLight {
  Trajectory signal;
  double last_signal;     ///< at the end of the sub-interval
  double expected_noise;  ///< 1/noise_unit
};

/// One pixel in one sub-interval. Times are microseconds after its start.
class Pixel {
 public:
  Pixel(RowToSolve& row, int x, const PixelLight& light)
      : row_(row),
        model_(*row.model),
        adaptation_(row.model->adaptation),
        sub_interval_(*row.sub_interval),
        pixels_(row.pixels),
        start_(sub_interval_.start),
        x_(x),
        number_(pixels_.number_of(x)),
        draw_(sub_interval_.number * draws_per_sub_interval),
        above_leak_(light.signal),
        reference_(pixels_.reference[x]),
        positive_(pixels_.positive[x]),
        negative_(pixels_.negative[x]),
        leak_(pixels_.leak[x] + sub_interval_.rise / sub_interval_.duration),
        ready_(pixels_.refractory_left[x]),
        holds_(model_.holds_reference()),
        growth_end_(adaptation_.is_on() ? pixels_.growth_end[x] : 0),
        noise_{light.expected_noise, static_cast<double>(pixels_.noise_budget[x])} {
    // A falling reference is equivalent to a rising signal.
    above_leak_.slope += leak_;
    end_ = {sub_interval_.duration, light.last_signal + leak_ * sub_interval_.duration};
  }

  void solve() {
    const Crossings crossings(above_leak_, end_);
    TrajectoryPoint now{0, above_leak_.offset + above_leak_.lag};
    int happened = 0;
    for (; happened < max_events; ++happened) {
      if (holds_ && ready_ > now.t) {
        if (ready_ > end_.t) break;
        now = at(ready_);
        reference_ = now.value;
      }
      const double noise = noise_.next(end_.t);
      const auto crossing = adaptation_.is_on() ? first_crossing(crossings, now)
                                                : crossings.first(reference_ - negative_,
                                                                  reference_ + positive_, now);
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
    noise_.skip(model_.random, number_, draw_);
    store();
  }

 private:
  TrajectoryPoint at(double t) const { return {t, above_leak_.at(t)}; }

  /// Handles a noise event due at `t`; `now` may be later.
  void make_noise(TrajectoryPoint now, double t) {
    noise_.draw(model_.random, number_, draw_++);
    if (t < ready_) return;
    reference_ = now.value;
    const bool is_on = model_.random.coin(number_, Random::Purpose::event, draw_++);
    fire(t, is_on ? Polarity::on : Polarity::off,
         row_.has_labels() ? Cause::shot_noise : Cause::unknown);
  }

  /// First crossing of the levels, which approach the reference while the thresholds' growth falls.
  std::optional<Crossing> first_crossing(const Crossings& crossings, TrajectoryPoint from) const {
    if (growth_end_ > start_ + from.t) {
      const double growth = adaptation_.growth(start_ + from.t, growth_end_);
      const TrajectoryPoint faded = at(std::min(growth_end_ - start_, end_.t));
      const auto on = crossing(positive_, growth, from, faded);
      const auto off = crossing(-negative_, growth, from, faded);
      if (on && (!off || on->point.t <= off->point.t)) return on;
      if (off || faded.t == end_.t) return off;
      from = faded;
    }
    return crossings.first(reference_ - negative_, reference_ + positive_, from);
  }

  /// First crossing of the level at `threshold` (negative for OFF) from the reference. Its growth
  /// is `growth` at `from` and falls until `to`.
  std::optional<Crossing> crossing(double threshold, double growth, TrajectoryPoint from,
                                   TrajectoryPoint to) const {
    if (std::isinf(threshold)) return std::nullopt;
    const double level = reference_ + threshold * (1 + growth);
    const double rise = threshold * adaptation_.rate();
    if (above_leak_.lag == 0) {  // most straight lines stay below the falling level
      const double sign = threshold > 0 ? 1 : -1;
      const double last_level = level - rise * (to.t - from.t);
      if (sign * (from.value - level) < 0 && sign * (to.value - last_level) < -rounding)
        return std::nullopt;
    }
    // A falling level is equivalent to a rising signal.
    auto signal = above_leak_;
    signal.slope += rise;
    signal.offset -= rise * from.t;
    const Crossings crossings(signal, {to.t, to.value + rise * (to.t - from.t)});
    auto found =
        threshold > 0 ? crossings.first(-never, level, from) : crossings.first(level, never, from);
    if (found) found->point.value -= rise * (found->point.t - from.t);
    return found;
  }

  void cross(const Crossing& crossing) {
    const double threshold = crossing.polarity == Polarity::on ? positive_ : -negative_;
    const double growth = adaptation_.growth(start_ + crossing.point.t, growth_end_);
    reference_ += threshold * (1 + growth);
    if (crossing.point.t < ready_) return;
    auto cause = Cause::unknown;
    if (row_.has_labels()) {
      const double fall = growth > 0 ? std::abs(threshold) * adaptation_.rate() : 0;
      const double light = above_leak_.slope_at(crossing.point.t) - leak_;
      cause = row_.cause_of_crossing(x_, crossing.polarity, light, fall);
    }
    fire(crossing.point.t, crossing.polarity, cause);
  }

  /// Emits an event and starts the refractory period.
  void fire(double crossed, Polarity polarity, Cause cause) {
    growth_end_ = adaptation_.prolonged(start_ + crossed, growth_end_);
    double t = crossed + model_.latency;
    if (model_.latency_jitter > 0) {
      const double jitter = model_.random.normals(number_, Random::Purpose::event, draw_++).first;
      t = std::max(crossed, t + model_.latency_jitter * jitter);
    }
    if (!std::isinf(positive_)) row_.add_event(x_, t, polarity, cause);
    ready_ = t + model_.gap;
    if (model_.has_threshold_jitter() && !std::isinf(positive_)) {
      const auto next = model_.next_thresholds(number_, draw_++);
      positive_ = next.positive;
      negative_ = next.negative;
    }
  }

  void store() {
    // Relative to the signal at the start of the next sub-interval.
    pixels_.reference[x_] = static_cast<float>(reference_ - leak_ * end_.t);
    pixels_.positive[x_] = static_cast<float>(positive_);
    pixels_.negative[x_] = static_cast<float>(negative_);
    pixels_.refractory_left[x_] = static_cast<float>(row_.refractory_left(ready_));
    pixels_.noise_budget[x_] = noise_.left();
    if (adaptation_.is_on()) pixels_.growth_end[x_] = growth_end_;
  }

  RowToSolve& row_;
  const PixelModel& model_;
  const Adaptation& adaptation_;
  const SubInterval& sub_interval_;
  const PixelRow& pixels_;
  double start_;  ///< of the sub-interval, microseconds since the first frame
  int x_;
  std::uint64_t number_;
  std::uint64_t draw_;

  Trajectory above_leak_;  ///< the signal relative to a reference without leak
  TrajectoryPoint end_{};
  double reference_;
  double positive_;
  double negative_;
  double leak_;   ///< fall of the reference per microsecond
  double ready_;  ///< earliest time of the next event
  bool holds_;    ///< a reset holds the reference at the signal until then
  double growth_end_;
  ShotNoise noise_;
};

void solve_pixel(RowToSolve& row, std::size_t i) {
  const int x = row.candidates.x[i];
  const auto shade = static_cast<std::size_t>(row.candidates.shade[i]);
  const auto value = [&](Candidates::Column column) -> double {
    return row.candidates.column(column)[i];
  };
  const double last_target = value(Candidates::last_target);
  const double target = value(Candidates::target);
  const double duration = row.sub_interval->duration;
  const bool has_bandwidth = row.model->has_bandwidth();
  const auto signal =
      has_bandwidth ? Trajectory::low_pass(value(Candidates::last_signal), last_target, target,
                                           duration, row.sub_interval->tables->bandwidth[shade])
                    : Trajectory::line(last_target, target, duration);
  const double last_signal = has_bandwidth ? value(Candidates::signal) : target;
  Pixel(row, x, {signal, last_signal, row.sub_interval->tables->expected_noise[shade]}).solve();
}

}  // namespace

void solve_pixels(RowToSolve& row) {
  for (std::size_t i = 0; i < row.candidates.count; ++i) solve_pixel(row, i);
}

void solve_noisy_pixels(RowToSolve& row) {
  auto& candidates = row.candidates;
  for (std::size_t i = 0; i < candidates.count;) {
    auto& budget = row.pixels.noise_budget[candidates.x[i]];
    const auto shade = static_cast<std::size_t>(candidates.shade[i]);
    const ShotNoise noise{row.sub_interval->tables->expected_noise[shade],
                          static_cast<double>(budget)};
    if (noise.next(row.sub_interval->duration) == never) {
      budget = noise.left();
      ++i;
    } else {
      solve_pixel(row, i);
      candidates.remove(i);
    }
  }
}

}  // namespace eventcamera
