// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/pixel_solver.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "src/dvs/shot_noise.hpp"
#include "src/dvs/trajectory.hpp"

#define HWY_TARGET_INCLUDE "src/dvs/line_solver.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/dvs/solver-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

/// A vector of candidates.
class Pixels {
 public:
  /// Candidates from `first` on.
  void begin(const RowToSolve& row, std::size_t first) {
    first_ = first;
    count_ = std::min(row.candidates.count - first, hn::Lanes(Doubles()));
  }

  std::size_t first() const { return first_; }
  Mask exist() const { return hn::FirstN(Doubles(), count_); }

  /// Their columns; 0 past the last candidate.
  auto x(const RowToSolve& row) const {
    const auto x = hn::LoadU(Words(), row.candidates.x.data() + first_);
    const auto existing = hn::IfThenElseZero(hn::FirstN(Words(), count_), x);
    return hn::PromoteTo(hn::RebindToSigned<Doubles>(), existing);
  }

  Values load(const RowToSolve& row, Candidates::Column column) const {
    return hn::PromoteTo(Doubles(), hn::LoadU(Floats(), row.candidates.column(column) + first_));
  }
  Values load(const RowToSolve& row, const double* values) const {
    return hn::GatherIndex(Doubles(), values, x(row));
  }

  /// Fall of the references within the sub-interval.
  Values fall(const RowToSolve& row) const {
    return load(row, Candidates::leak) * all(row.sub_interval->duration) +
           all(row.sub_interval->rise);
  }

  void store(const RowToSolve& row, Values stored, float* values) const {
    store(row, exist(), stored, values);
  }
  void store(const RowToSolve& row, Values stored, double* values) const {
    HWY_ALIGN double lanes[max_lanes];
    hn::Store(stored, Doubles(), lanes);
    store(row, exist(), lanes, values);
  }

  /// Stores the values of some candidates.
  void store(const RowToSolve& row, Mask some, Values stored, float* values) const {
    HWY_ALIGN float lanes[max_lanes];
    hn::Store(hn::DemoteTo(Floats(), stored), Floats(), lanes);
    store(row, some, lanes, values);
  }

  /// Stores RowToSolve::refractory_left(), if any is or was.
  void store_refractory_left(const RowToSolve& row, Values ready) const {
    auto left = hn::Max(all(0), ready - all(row.sub_interval->duration));
    const auto is_short = hn::And(left > all(0), left < all(min_gap));
    left = left + hn::IfThenElseZero(is_short, all(row.sub_interval->next_rounding));
    const auto is_or_was = hn::Max(left, load(row, Candidates::refractory_left)) > all(0);
    if (hn::AllFalse(Doubles(), hn::And(is_or_was, exist()))) return;
    store(row, left, row.pixels.refractory_left);
  }

 private:
  template <class T>
  void store(const RowToSolve& row, Mask some, const T* stored, T* values) const {
    const std::int32_t* x = row.candidates.x.data() + first_;
    for (auto bits = bits_of(Doubles(), some); bits != 0; bits &= bits - 1) {
      const int lane = std::countr_zero(bits);
      values[x[lane]] = stored[lane];
    }
  }

  std::size_t first_;
  std::size_t count_;
};

/// Vectors of candidates that are solved in turns, because the processor can overlap their
/// operations: successive crossings of one pixel depend on each other.
constexpr std::size_t max_vectors = 16;

/// Adds events of vectors of pixels.
class Events {
 public:
  explicit Events(RowToSolve& row)
      : row_(row),
        begin_(row.sub_interval->begin),
        end_(row.events.duration()),
        place_of_row_(static_cast<std::uint64_t>(row.pixels.y) << 48) {}

  /// Adds an event at the time `t` of each pixel in `fire`. Its threshold is falling if the pixel
  /// is in `fading`.
  void add(const Pixels& pixels, Mask fire, Mask on, Mask fading, Values t) {
    const Doubles doubles;
    const Bits bits;
    // 2^52 + n has n in its lowest bits.
    const auto time = hn::Floor(hn::Min(all(begin_) + t, all(end_)));
    const auto microseconds =
        hn::And(hn::BitCast(bits, time + all(0x1p52)), hn::Set(bits, 0xffffffff));
    const auto x = hn::ShiftLeft<32>(hn::BitCast(bits, pixels.x(row_)));
    const auto place = hn::Or(x, hn::Set(bits, place_of_row_));
    const auto polarity =
        hn::IfThenElseZero(hn::RebindMask(bits, on), hn::Set(bits, std::uint64_t{1} << 63));
    const auto events = hn::Or(hn::Or(microseconds, place), polarity);
    if (HWY_UNLIKELY(row_.has_labels())) return add_with_causes(pixels, fire, fading, events);
    HWY_ALIGN std::uint64_t firing[max_lanes / 2];
    hn::Store(FirstLanes<Bits>(hn::RebindMask(bits, fire))(events), bits, firing);
    std::memcpy(events_ + count_, firing, hn::Lanes(bits) * sizeof(Event));
    count_ += hn::CountTrue(doubles, fire);
  }

  /// Call after each turn.
  void flush() {
    row_.events.add({events_, count_});
    count_ = 0;
  }

 private:
  void add_with_causes(const Pixels& pixels, Mask fire, Mask fading, hn::Vec<Bits> events) {
    const Doubles doubles;
    HWY_ALIGN std::uint64_t words[max_lanes];
    hn::Store(events, Bits(), words);
    const auto fading_bits = bits_of(doubles, fading);
    for (auto bits = bits_of(doubles, fire); bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      const auto event = std::bit_cast<Event>(words[lane]);
      const int x = event.x;
      const bool is_on = event.polarity() == Polarity::on;
      const double threshold = is_on ? row_.pixels.positive[x] : row_.pixels.negative[x];
      const bool falls = (fading_bits >> lane & 1) != 0;
      const double fall = falls ? threshold * row_.model->adaptation.rate() : 0;
      const float* last_targets = row_.candidates.column(Candidates::last_target);
      const double rise = double{row_.pixels.target[x]} - last_targets[pixels.first() + lane];
      const auto cause =
          row_.cause_of_crossing(x, event.polarity(), rise / row_.sub_interval->duration, fall);
      row_.pixels.last_cause[x] = cause;
      events_[count_++] = with_cause(event, cause);
    }
  }

  RowToSolve& row_;
  double begin_;
  double end_;
  std::uint64_t place_of_row_;
  std::size_t count_ = 0;
  Event events_[(max_vectors + 1) * max_lanes / 2];
};

/// Growth of the thresholds of a vector of pixels, as a fraction of the thresholds. It falls to 0,
/// or until the sub-interval ends.
struct Growth {
  Values first;
  Values last;  ///< after the fall
  Values rate;  ///< of the fall, per microsecond
  Values fall;  ///< duration of the fall, microseconds
  Values left;  ///< until the sub-interval ends
};

/// Time until signals that start at `value` with this slope reach the thresholds; infinite if later
/// than `left`, the rest of the sub-interval in microseconds.
HWY_INLINE Values wait(Values value, Values slope, Values threshold, Values left) {
  const auto is_beyond = value >= threshold;
  const auto meets = value + slope * left >= threshold - all(rounding);
  const auto time = (threshold - value) / slope;
  const auto found = hn::IfThenElseZero(hn::Not(is_beyond), hn::Min(hn::Max(time, all(0)), left));
  return hn::IfThenElse(hn::Or(is_beyond, meets), found, hn::Inf(Doubles()));
}

/// Time until signals reach thresholds whose growth falls.
HWY_INLINE Values wait(Values value, Values slope, Values threshold, const Growth& growth) {
  const auto one = all(1);
  const auto margin = all(rounding);
  const auto level = threshold * (one + growth.first);
  const auto last_level = threshold * (one + growth.last);
  const auto value_after = [&](Values t) HWY_ATTR { return value + slope * t; };
  const auto is_beyond = value >= level;
  const auto meets = value_after(growth.fall) >= last_level - margin;
  const auto reaches =
      hn::And(growth.fall < growth.left, value_after(growth.left) >= threshold - margin);
  const auto way = hn::IfThenElse(meets, level, threshold) - value;
  const auto approach = slope + threshold * growth.rate;
  const auto time = way / hn::IfThenElse(meets, approach, slope);
  const auto limit = hn::IfThenElse(meets, growth.fall, growth.left);
  const auto found = hn::IfThenElseZero(hn::Not(is_beyond), hn::Min(hn::Max(time, all(0)), limit));
  return hn::IfThenElse(hn::Or(is_beyond, hn::Or(meets, reaches)), found, hn::Inf(Doubles()));
}

/// Straight-line signals of a vector of pixels. Thresholds may vary by adaptation, or by jitter
/// without mismatch.
template <bool thresholds_vary>
class Lines {
 public:
  // Not defaulted: GCC 12 compiles a defaulted constructor without the target's instructions.
  Lines() {}  // NOLINT(*-member-init,*-use-equals-default)

  void begin(const RowToSolve& row, std::size_t candidate) {
    pixels_.begin(row, candidate);
    fall_ = pixels_.fall(row);
    first_ = pixels_.load(row, Candidates::last_target);
    last_ = pixels_.load(row, Candidates::target) + fall_;
    slope_ = (last_ - first_) / all(row.sub_interval->duration);
    positive_ = pixels_.load(row, Candidates::positive);
    negative_ = pixels_.load(row, Candidates::negative);
    reference_ = pixels_.load(row, Candidates::reference);
    ready_ = pixels_.load(row, Candidates::refractory_left);
    t_ = all(0);
    crosses_ = pixels_.exist();
    if constexpr (thresholds_vary) {
      growth_end_ = pixels_.load(row, row.pixels.growth_end) - all(row.sub_interval->start);
      if (row.model->has_threshold_jitter()) begin_draws(row);
    }
  }

  /// Finds the next crossing of each pixel. Returns false if there is none.
  bool advance(const RowToSolve& row, Events& events) {
    const Doubles doubles;
    const auto& adaptation = row.model->adaptation;
    const auto rate = all(adaptation.rate());
    const auto value = first_ + slope_ * t_ - reference_;
    const auto left = all(row.sub_interval->duration) - t_;
    Values on_wait;
    Values off_wait;
    if constexpr (thresholds_vary) {
      const auto growth_left = hn::Max(growth_end_ - t_, all(0));
      const auto fall = hn::Min(growth_left, left);
      const Growth growth{rate * growth_left, rate * (growth_left - fall), rate, fall, left};
      on_wait = wait(value, slope_, positive_, growth);
      off_wait = wait(hn::Neg(value), hn::Neg(slope_), negative_, growth);
    } else {
      on_wait = wait(value, slope_, positive_, left);
      off_wait = wait(hn::Neg(value), hn::Neg(slope_), negative_, left);
    }
    const auto is_on = on_wait <= off_wait;
    const auto wait_time = hn::IfThenElse(is_on, on_wait, off_wait);
    crosses_ = hn::And(crosses_, wait_time < hn::Inf(doubles));
    if (hn::AllFalse(doubles, crosses_)) return false;
    t_ = hn::IfThenElse(crosses_, t_ + wait_time, t_);
    const auto threshold = hn::IfThenElse(is_on, positive_, hn::Neg(negative_));
    auto growth = all(0);
    if constexpr (thresholds_vary) growth = rate * hn::Max(growth_end_ - t_, all(0));
    const auto level = reference_ + threshold * (all(1) + growth);
    reference_ = hn::IfThenElse(crosses_, level, reference_);
    const auto fires = hn::And(crosses_, t_ >= ready_);
    events.add(pixels_, fires, is_on, growth > all(0), t_);
    ready_ = hn::IfThenElse(fires, t_ + all(row.model->gap), ready_);
    if constexpr (thresholds_vary) {
      const auto prolonged = hn::Max(t_, growth_end_) + all(adaptation.duration());
      growth_end_ = hn::IfThenElse(fires, prolonged, growth_end_);
      if (row.model->has_threshold_jitter()) draw_thresholds(row, fires);
    }
    return true;
  }

  void end(const RowToSolve& row) const {
    const auto reference = hn::IfThenElse(crosses_, last_, reference_);
    pixels_.store(row, reference - fall_, row.pixels.reference);
    pixels_.store_refractory_left(row, ready_);
    if constexpr (thresholds_vary) {
      if (row.model->adaptation.is_on())
        pixels_.store(row, all(row.sub_interval->start) + growth_end_, row.pixels.growth_end);
      if (row.model->has_threshold_jitter()) {
        pixels_.store(row, drawn_, positive_, row.pixels.positive);
        pixels_.store(row, drawn_, negative_, row.pixels.negative);
      }
    }
  }

 private:
  void begin_draws(const RowToSolve& row) {
    const Bits bits;
    const auto numbers = hn::BitCast(bits, pixels_.x(row)) + hn::Set(bits, row.pixels.first_number);
    random_ = RandomSeries(row.model->random, numbers, Random::Purpose::event);
    draw_ = hn::Set(bits, row.sub_interval->number * draws_per_sub_interval);
    drawn_ = hn::FirstN(Doubles(), 0);
  }

  /// Draws the thresholds after the events of these pixels.
  void draw_thresholds(const RowToSolve& row, Mask fire) {
    const auto [first, second] = random_.normals(draw_);
    const auto drawn = [&](Values normal, double mean) HWY_ATTR {
      const auto threshold = all(mean) + all(row.model->settings.threshold_jitter) * normal;
      return hn::Max(threshold, all(min_threshold_of(mean)));
    };
    positive_ = hn::IfThenElse(fire, drawn(first, row.model->mean_thresholds.positive), positive_);
    negative_ = hn::IfThenElse(fire, drawn(second, row.model->mean_thresholds.negative), negative_);
    drawn_ = hn::Or(drawn_, fire);
    const Bits bits;
    draw_ = hn::IfThenElse(hn::RebindMask(bits, fire), draw_ + hn::Set(bits, 1), draw_);
  }

  Pixels pixels_;
  Mask crosses_;  ///< in all passes so far
  Values fall_;   ///< of the references
  Values first_;  ///< signals at the start of the sub-interval
  Values last_;   ///< at its end, with the fall of the references
  Values slope_;
  Values positive_;
  Values negative_;
  Values reference_;
  Values ready_;  ///< earliest time of the next event
  Values growth_end_;
  Values t_;  ///< of the last crossing
  RandomSeries random_;
  hn::Vec<Bits> draw_;  ///< counter of the next random number
  Mask drawn_;          ///< pixels whose thresholds were drawn
};

/// Finds the first crossing in each vector, then the second ones, and so on.
template <class Signals>
void solve_in_turns(RowToSolve& row) {
  Events events(row);
  Signals signals[max_vectors];
  std::size_t crossing[max_vectors];
  const std::size_t lanes = hn::Lanes(Doubles());
  for (std::size_t first = 0; first < row.candidates.count; first += max_vectors * lanes) {
    const std::size_t vectors =
        std::min((row.candidates.count - first + lanes - 1) / lanes, max_vectors);
    for (std::size_t i = 0; i < vectors; ++i) {
      signals[i].begin(row, first + i * lanes);
      crossing[i] = i;
    }
    std::size_t left = vectors;
    for (int event = 0; event < max_events && left > 0; ++event) {
      std::size_t kept = 0;
      for (std::size_t i = 0; i < left; ++i) {
        crossing[kept] = crossing[i];
        if (signals[crossing[i]].advance(row, events)) ++kept;
      }
      events.flush();
      left = kept;
    }
    for (std::size_t i = 0; i < vectors; ++i) signals[i].end(row);
  }
}

void solve(RowToSolve& row) {
  if (row.model->adaptation.is_on() || row.model->has_threshold_jitter())
    solve_in_turns<Lines<true>>(row);
  else
    solve_in_turns<Lines<false>>(row);
}

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(solve);

void solve_lines(RowToSolve& row) {
  if (row.model->has_noise()) solve_noisy_pixels(row);
  HWY_DYNAMIC_DISPATCH(solve)(row);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
