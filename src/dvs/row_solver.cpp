// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/pixel_solver.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "src/dvs/trajectory.hpp"

#define HWY_TARGET_INCLUDE "src/dvs/row_solver.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/dvs/solver-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

struct Points {
  Values t;
  Values value;
};

/// Trajectories whose slope never decreases, like those in Crossings.
struct Trajectories {
  Values offset;
  Values slope;
  Values bandwidth;

  HWY_INLINE Values lag_at(const Points& points) const {
    return points.value - offset - slope * points.t;
  }
  HWY_INLINE Values slope_at(const Points& points) const {
    return slope - bandwidth * lag_at(points);
  }

  /// Value at a time after `points`.
  HWY_INLINE Values at(Values t, const Points& points) const {
    return offset + slope * t + lag_at(points) * decays(bandwidth * (t - points.t));
  }

  /// Like Crossings::turn_after().
  HWY_INLINE Points turn_after(const Points& from, const Points& end) const {
    const auto final_lag = slope / bandwidth;
    const auto ratio = lag_at(from) / final_lag;
    const auto t = from.t + logarithms(ratio) / bandwidth;
    const auto value = offset + slope * t + final_lag;
    const auto is_before_end = t < end.t;
    const auto turns = ratio > all(1);
    return {hn::IfThenElse(turns, hn::IfThenElse(is_before_end, t, end.t), from.t),
            hn::IfThenElse(turns, hn::IfThenElse(is_before_end, value, end.value), from.value)};
  }

  /// Like Crossings::time_of(), for the lanes of `wanted`.
  HWY_INLINE Values times_of(Values levels, const Points& a, const Points& b, Mask wanted) const {
    const auto zero = all(0);
    const auto two = all(2);
    const auto precision = all(crossing_precision);
    const auto rise = levels - a.value;
    const auto duration = b.t - a.t;
    const auto secant = hn::Min(hn::Max(rise / (b.value - a.value), zero), all(1)) * duration;
    const auto lag = lag_at(a);
    const auto rises = b.value > a.value;
    const auto half = slope - bandwidth * (lag + rise * all(0.5));
    const auto square = half * half + two * slope * bandwidth * rise;
    const auto root = hn::Sqrt(hn::Max(zero, square));
    auto t = two * rise / (half + hn::IfThenElse(rises, root, hn::Neg(root)));
    t = hn::IfThenElse(hn::And(t >= zero, t <= duration), t, secant);
    auto early = zero;
    auto late = duration;
    auto left = wanted;
    for (int i = 0; i < max_iterations && !hn::AllFalse(Doubles(), left); ++i) {
      const auto lag_left = lag * decays(bandwidth * t);
      const auto beyond = slope * t - (lag - lag_left) - rise;
      const auto is_late = hn::Not(hn::Xor(beyond > zero, rises));
      late = hn::IfThenElse(is_late, t, late);
      early = hn::IfThenElse(is_late, early, t);
      const auto slope_here = slope - bandwidth * lag_left;
      const auto curvature = bandwidth * bandwidth * lag_left;
      const auto step =
          two * beyond * slope_here / (two * slope_here * slope_here - beyond * curvature);
      const auto next = t - step;
      const auto is_within = hn::And(next >= early, next <= late);
      t = hn::IfThenElse(left, hn::IfThenElse(is_within, next, (early + late) * all(0.5)), t);
      const auto length = hn::Abs(step);
      const auto slope_there = slope_here - curvature * step;
      const auto min_slope_squared = hn::Min(slope_here * slope_here, slope_there * slope_there);
      const auto error = length * length * length *
                         (curvature * curvature * all(0.25) +
                          hn::Abs(curvature * bandwidth * slope_here) * all(1.0 / 6));
      const auto is_short = bandwidth * length < all(0.5);
      const auto is_precise = hn::Or(length < precision, error < precision * min_slope_squared);
      const auto is_done =
          hn::Or(late - early < precision, hn::And(hn::And(is_within, is_short), is_precise));
      left = hn::And(left, hn::Not(is_done));
    }
    return a.t + t;
  }
};

class RowSolver {
 public:
  explicit RowSolver(RowToSolve& row)
      : row_(row),
        unsolved_(row.unsolved),
        duration_(row.sub_interval->duration),
        has_bandwidth_(row.model->has_bandwidth()),
        holds_(row.model->holds_reference()) {}

  void solve() {
    begin();
    for (int i = 0; count_ > 0 && i < max_events; ++i) pass();
    for (std::size_t i = 0; i < count_; ++i) store_at_end(i);
  }

 private:
  using Column = UnsolvedPixels::Column;

  std::size_t lanes() const { return hn::Lanes(Doubles()); }

  void begin() {
    const auto& candidates = row_.candidates;
    count_ = candidates.count;
    unsolved_.resize(count_ + lanes());
    for (std::size_t i = 0; i < count_; i += lanes()) begin(i);
    for (std::size_t i = 0; i < count_; ++i) {
      const auto shade = static_cast<std::size_t>(candidates.shade[i]);
      const double budget = row_.pixels.noise_budget[candidates.x[i]];
      auto& noise = unsolved_.noise[i];
      noise = {row_.sub_interval->tables->expected_noise[shade], budget};
      unsolved_.column(Column::next_noise)[i] = noise.next(duration_);
    }
    std::fill_n(unsolved_.draws.begin(), count_,
                row_.sub_interval->number * draws_per_sub_interval);
  }

  void begin(std::size_t i) {
    const Doubles doubles;
    const Words words;
    const auto& candidates = row_.candidates;
    const auto within = hn::FirstN(words, count_ - i);
    const auto shade = hn::IfThenElseZero(within, hn::LoadU(words, candidates.shade.data() + i));
    const auto load = [&](Candidates::Column column) {
      return hn::PromoteTo(doubles, hn::LoadU(Floats(), candidates.column(column) + i));
    };
    const auto store = [&](Column column, const Values& values) {
      hn::StoreU(values, doubles, unsolved_.column(column) + i);
    };
    const auto duration = all(duration_);
    const auto from = load(Candidates::last_target);
    const auto fall = load(Candidates::leak) + all(row_.sub_interval->rise / duration_);
    auto last_value = load(Candidates::target);
    const auto light_slope = (last_value - from) / duration;
    auto value = from;
    auto offset = from;
    auto bandwidth = all(0);
    auto sign = all(1);
    if (has_bandwidth_) {
      bandwidth = hn::GatherIndex(doubles, row_.sub_interval->tables->bandwidth.data(),
                                  hn::PromoteTo(hn::RebindToSigned<Doubles>(), shade));
      value = load(Candidates::last_signal);
      last_value = load(Candidates::signal);
      offset = from - light_slope / bandwidth;
      sign = hn::CopySign(sign, value - offset);
    }
    const auto end = last_value + fall * duration;
    const auto positive = load(Candidates::positive);
    const auto negative = load(Candidates::negative);
    const auto is_upright = sign > all(0);
    store(Column::index, iota(doubles, static_cast<double>(i)));
    store(Column::sign, sign);
    store(Column::t, all(0));
    store(Column::value, sign * value);
    store(Column::end, sign * end);
    store(Column::offset, sign * offset);
    store(Column::slope, sign * (light_slope + fall));
    store(Column::bandwidth, bandwidth);
    store(Column::reference, sign * load(Candidates::reference));
    store(Column::to_far, hn::IfThenElse(is_upright, positive, negative));
    store(Column::to_near, hn::IfThenElse(is_upright, negative, positive));
    store(Column::ready, load(Candidates::refractory_left));
  }

  /// Finds the next event of each pixel; stores pixels that have none.
  void pass() {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count_; i += lanes()) kept += advance(i, kept);
    count_ = kept;
  }

  std::size_t advance(std::size_t i, std::size_t kept) {
    const Doubles doubles;
    const auto load = [&](Column column) {
      return hn::LoadU(doubles, unsolved_.column(column) + i);
    };
    const auto exist = hn::FirstN(doubles, count_ - i);
    const Trajectories trajectories{load(Column::offset), load(Column::slope),
                                    load(Column::bandwidth)};
    Points now{load(Column::t), load(Column::value)};
    const Points end{all(duration_), load(Column::end)};
    auto reference = load(Column::reference);
    const auto to_far = load(Column::to_far);
    const auto to_near = load(Column::to_near);
    const auto ready = load(Column::ready);
    const auto noise = load(Column::next_noise);
    const auto sign = load(Column::sign);
    // A reset holds the reference at the signal until the pixel is ready, possibly past the end.
    const auto held_until = holds_ ? ready : all(0);
    const auto stays_held = held_until > end.t;
    const auto is_released = hn::And(held_until > now.t, hn::Not(stays_held));
    if (!hn::AllFalse(doubles, is_released)) {
      now.value = hn::IfThenElse(is_released, trajectories.at(ready, now), now.value);
      now.t = hn::IfThenElse(is_released, ready, now.t);
      reference = hn::IfThenElse(is_released, now.value, reference);
      hn::StoreU(reference, doubles, unsolved_.column(Column::reference) + i);
    }
    const auto far = reference + to_far;
    const auto near = reference - to_near;
    const auto margin = all(rounding);
    const auto within = hn::And(exist, hn::Not(stays_held));

    // Like Crossings::first().
    const auto is_far = now.value >= far;
    const auto is_near = now.value <= near;
    const auto is_crossed = hn::Or(is_far, is_near);
    auto crosses_near = end.value <= near + margin;
    auto until = end;
    if (has_bandwidth_) {
      const auto first_slope = trajectories.slope_at(now);
      const auto last_slope = trajectories.slope_at(end);
      const auto turns = hn::And(hn::And(within, end.value > near),
                                 hn::And(all(0) > first_slope, last_slope > all(0)));
      crosses_near = hn::And(crosses_near, hn::Not(turns));
      const auto to_meeting =
          (end.value - now.value - last_slope * (end.t - now.t)) / (first_slope - last_slope);
      const auto lowest = now.value + first_slope * to_meeting;
      const auto may_cross = hn::And(turns, lowest <= near + margin);
      if (!hn::AllFalse(doubles, may_cross)) {
        const auto turn = trajectories.turn_after(now, end);
        const auto crosses = hn::And(may_cross, turn.value <= near + margin);
        until.t = hn::IfThenElse(crosses, turn.t, until.t);
        until.value = hn::IfThenElse(crosses, turn.value, until.value);
        crosses_near = hn::Or(crosses_near, crosses);
      }
    }
    crosses_near = hn::And(hn::Or(crosses_near, is_near), hn::Not(is_far));
    const auto crosses_far = hn::Or(end.value >= far - margin, is_far);
    const auto crosses = hn::And(within, hn::Or(crosses_near, crosses_far));
    const auto level = hn::IfThenElse(crosses_near, near, far);
    const auto wanted = hn::And(crosses, hn::Not(is_crossed));
    auto t = now.t;
    if (!hn::AllFalse(doubles, wanted)) {
      const auto times = has_bandwidth_ ? trajectories.times_of(level, now, until, wanted)
                                        : secants(level, now, until);
      t = hn::IfThenElse(wanted, times, t);
    }
    auto value = hn::IfThenElse(is_crossed, now.value, level);
    auto next_reference = level;

    const auto is_noise = hn::And(within, noise <= hn::IfThenElse(crosses, t, all(duration_)));
    const auto happens = hn::Or(crosses, is_noise);
    const auto is_ready = hn::IfThenElse(is_noise, noise, t) >= ready;
    if (!hn::AllFalse(doubles, is_noise)) {
      t = hn::IfThenElse(is_noise, hn::Max(noise, now.t), t);
      value = hn::IfThenElse(is_noise, trajectories.at(t, now), value);
      next_reference =
          hn::IfThenElse(is_noise, hn::IfThenElse(is_ready, value, reference), next_reference);
    }
    const auto fires = hn::And(happens, is_ready);
    const auto is_off = hn::Xor(crosses_near, sign < all(0));

    const auto noise_bits = bits_of(doubles, is_noise);
    const auto fire_bits = bits_of(doubles, fires);
    const auto on_bits = ~bits_of(doubles, is_off);
    const auto emitted = emissions(i, t, noise_bits);
    HWY_ALIGN double times[max_lanes];
    HWY_ALIGN double emission_times[max_lanes];
    hn::Store(t, doubles, times);
    hn::Store(emitted, doubles, emission_times);
    for (auto bits = fire_bits | noise_bits; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      const auto is_set = [lane](std::uint64_t mask) { return (mask >> lane & 1) != 0; };
      if (is_set(noise_bits))
        make_noise(i + lane, emission_times[lane], is_set(fire_bits));
      else
        cross(i + lane, times[lane], emission_times[lane], is_set(on_bits));
      if (has_latency_jitter() && is_set(fire_bits)) ++unsolved_.draws[index_of(i + lane)];
    }
    for (auto bits = bits_of(doubles, hn::And(exist, hn::Not(happens))); bits != 0;
         bits &= bits - 1)
      store(i + static_cast<std::size_t>(std::countr_zero(bits)));

    const FirstLanes<Doubles> kept_lanes(happens);
    const auto keep = [&](Column column, const Values& values) {
      hn::StoreU(kept_lanes(values), doubles, unsolved_.column(column) + kept);
    };
    const auto next_noise = load(Column::next_noise);
    keep(Column::index, load(Column::index));
    keep(Column::sign, sign);
    keep(Column::t, t);
    keep(Column::value, value);
    keep(Column::end, end.value);
    keep(Column::offset, trajectories.offset);
    keep(Column::slope, trajectories.slope);
    keep(Column::bandwidth, trajectories.bandwidth);
    keep(Column::reference, next_reference);
    keep(Column::to_far, to_far);
    keep(Column::to_near, to_near);
    keep(Column::next_noise, next_noise);
    keep(Column::ready, hn::IfThenElse(fires, emitted + all(row_.model->gap), ready));
    return hn::CountTrue(doubles, happens);
  }

  /// Times at which the events of crossings at `t` are emitted: later by the latency.
  Values emissions(std::size_t i, Values t, std::uint64_t noise_bits) {
    const PixelModel& model = *row_.model;
    if (model.latency == 0 && !has_latency_jitter()) return t;
    const auto emitted = t + all(model.latency);
    if (!has_latency_jitter()) return emitted;
    const Bits bits;
    HWY_ALIGN std::uint64_t numbers[max_lanes / 2] = {};
    HWY_ALIGN std::uint64_t counters[max_lanes / 2] = {};
    for (std::size_t lane = 0; lane < std::min(lanes(), count_ - i); ++lane) {
      numbers[lane] = row_.pixels.number_of(x_of(i + lane));
      // Noise draws its next event and its polarity first.
      counters[lane] = unsolved_.draws[index_of(i + lane)] + 2 * (noise_bits >> lane & 1);
    }
    const RandomSeries random(row_.model->random, hn::Load(bits, numbers), Random::Purpose::event);
    const auto normal = random.normals(hn::Load(bits, counters)).first;
    return hn::Max(t, emitted + all(model.latency_jitter) * normal);
  }

  bool has_latency_jitter() const { return row_.model->latency_jitter > 0; }

  static HWY_INLINE Values secants(Values level, const Points& a, const Points& b) {
    const auto share = (level - a.value) / (b.value - a.value);
    return a.t + hn::Min(hn::Max(share, all(0)), all(1)) * (b.t - a.t);
  }

  std::size_t index_of(std::size_t i) {
    return static_cast<std::size_t>(unsolved_.column(Column::index)[i]);
  }
  int x_of(std::size_t i) { return row_.candidates.x[index_of(i)]; }

  /// Adds the event of a crossing; the columns of the pixel are not updated yet.
  void cross(std::size_t i, double t, double emitted, bool is_on) {
    const int x = x_of(i);
    const auto polarity = is_on ? Polarity::on : Polarity::off;
    auto cause = Cause::unknown;
    if (row_.has_labels()) {
      const double light = slope_at(i, t) - fall_of(x);
      cause = row_.cause_of_crossing(x, polarity, light, 0);
    }
    row_.add_event(x, emitted, polarity, cause);
  }

  /// Slope of a signal relative to its reference, at a time after Column::t.
  double slope_at(std::size_t i, double t) {
    const auto at = [&](Column column) { return unsolved_.column(column)[i]; };
    const double lag = at(Column::value) - at(Column::offset) - at(Column::slope) * at(Column::t);
    const double lag_left = lag * decay(at(Column::bandwidth) * (t - at(Column::t)));
    return at(Column::sign) * (at(Column::slope) - at(Column::bandwidth) * lag_left);
  }

  /// Fall of the reference per microsecond.
  double fall_of(int x) const { return row_.pixels.leak[x] + row_.sub_interval->rise / duration_; }

  void make_noise(std::size_t i, double emitted, bool fires) {
    const auto index = index_of(i);
    const int x = x_of(i);
    const auto number = row_.pixels.number_of(x);
    auto& noise = unsolved_.noise[index];
    auto& draw = unsolved_.draws[index];
    noise.draw(row_.model->random, number, draw++);
    unsolved_.column(Column::next_noise)[i] = noise.next(duration_);
    if (!fires) return;
    const bool is_on = row_.model->random.coin(number, Random::Purpose::event, draw++);
    if (!std::isinf(row_.pixels.positive[x]))
      row_.add_event(x, emitted, is_on ? Polarity::on : Polarity::off,
                     row_.has_labels() ? Cause::shot_noise : Cause::unknown);
  }

  void store(std::size_t i) {
    const auto index = index_of(i);
    const int x = row_.candidates.x[index];
    const auto& pixels = row_.pixels;
    const double reference =
        unsolved_.column(Column::sign)[i] * unsolved_.column(Column::reference)[i];
    pixels.reference[x] = static_cast<float>(reference - fall_of(x) * duration_);
    pixels.refractory_left[x] =
        static_cast<float>(row_.refractory_left(unsolved_.column(Column::ready)[i]));
    auto& noise = unsolved_.noise[index];
    noise.skip(row_.model->random, row_.pixels.number_of(x), unsolved_.draws[index]);
    pixels.noise_budget[x] = noise.left();
  }

  /// Stores a pixel that has reached max_events, with its reference at the final signal.
  void store_at_end(std::size_t i) {
    unsolved_.column(Column::reference)[i] = unsolved_.column(Column::end)[i];
    store(i);
  }

  RowToSolve& row_;
  UnsolvedPixels& unsolved_;
  double duration_;
  bool has_bandwidth_;
  bool holds_;             ///< the refractory period holds the reference at the signal
  std::size_t count_ = 0;  ///< pixels in the columns
};

void solve(RowToSolve& row) {
  RowSolver(row).solve();
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(solve);

void solve_row(RowToSolve& row) {
  HWY_DYNAMIC_DISPATCH(solve)(row);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
