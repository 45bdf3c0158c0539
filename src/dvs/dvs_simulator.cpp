// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/dvs_simulator.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "src/core/luma.hpp"
#include "src/core/thread_pool.hpp"
#include "src/dvs/denoise.hpp"
#include "src/dvs/exposure_gain.hpp"
#include "src/dvs/interval_events.hpp"
#include "src/dvs/interval_plans.hpp"
#include "src/dvs/line_solver.hpp"
#include "src/dvs/motion_tiles.hpp"
#include "src/dvs/moving_light.hpp"
#include "src/dvs/pixel_solver.hpp"
#include "src/dvs/readout.hpp"
#include "src/dvs/row_filter.hpp"
#include "src/dvs/row_solver.hpp"
#include "src/simulate/difference.hpp"
#include "src/simulate/frame_flow.hpp"

namespace eventcamera {
namespace {

/// True if both settings give each pixel the same traits.
bool have_same_traits(const DvsSettings& a, const DvsSettings& b) {
  return a.positive_threshold == b.positive_threshold &&
         a.negative_threshold == b.negative_threshold && a.threshold_sigma == b.threshold_sigma &&
         a.leak_rate == b.leak_rate && a.leak_spread == b.leak_spread &&
         a.hot_pixels == b.hot_pixels && a.dead_pixels == b.dead_pixels && a.seed == b.seed;
}

bool have_same_response(const DvsSettings& a, const DvsSettings& b) {
  return a.linear_light == b.linear_light && a.exposure_compensation == b.exposure_compensation &&
         a.response == b.response && a.log_eps == b.log_eps &&
         a.overexposed_light == b.overexposed_light;
}

/// Limit of the gain since the first frame, in case many estimates err in the same direction.
constexpr double max_total_gain = 64;

/// Event rate limit that no array reaches, events per second.
constexpr double unlimited = 1e18;

/// Scratch memory of a thread.
struct alignas(64) Scratch {
  Candidates candidates;
  UnsolvedPixels unsolved;
  std::vector<Event> added;           ///< events of a band
  std::vector<std::uint16_t> luma;    ///< a row, padded for vectors
  std::vector<std::uint16_t> moving;  ///< a run for each blended frame, padded
};

/// Maximum width of a run of pixels that move: all its blended frames stay in a cache.
constexpr int max_moving = 8 * MotionTiles::width;

/// Elements from one row of Scratch::moving to the next.
constexpr int moving_stride = max_moving + max_lanes;

template <class Pixel>
class PixelSimulator final : public DvsSimulator {
 public:
  explicit PixelSimulator(const LumaFormat& format) : DvsSimulator(format) {}

 private:
  bool needs_flow() const override { return settings_.upsampling == Upsampling::motion; }

  void start(const LumaView& frame) override {
    copy_luma(frame, last_);
    frame_flow_.forget();
    plans_.restart();
    clock_ = 0;
    fired_.reset();
    if (readout_) readout_->reset();
    if (gain_ != 1) responses_.clear();  // of another exposure
    keep_causes();
    adopt(settings_, true);
    settle();
    for (int y = 0; y < format().height; ++y)
      std::fill_n(pixels_.row(y).refractory_left, format().width, 0.0F);
  }

  void simulate(const LumaView& frame, const StepTimes& interval, const Settings&,
                EventBuckets& events) override {
    copy_luma(frame, now_);
    const double duration = begin(interval, events);
    if (current_.exposure_compensation) compensate_exposure();
    if (current_.upsampling == Upsampling::motion)
      advance_along_motion(duration);
    else
      advance_straight(duration, true);
    finish(duration, events);
    std::swap(last_, now_);
  }

  bool hold(const StepTimes& interval, const Settings&, EventBuckets& events) override {
    now_.assign(last_.view());
    const double duration = begin(interval, events);
    advance_straight(duration, false);
    finish(duration, events);
    return true;
  }

  void label(const LabelledEvents& events) override { separate_causes(events); }

  /// Copies the luma of a frame, denoised.
  void copy_luma(const LumaView& frame, Image<Pixel>& out) {
    if (frame.is_narrow != is_narrow_) {
      is_narrow_ = frame.is_narrow;
      if (!responses_.empty()) responses_ = responses_to_luma(current_);
    }
    const int white = (1 << format().bits) - 1;
    const int limit = static_cast<int>(std::lround(settings_.denoise / 255 * white));
    if (limit > 0)
      denoise(frame.as<Pixel>(), limit, threads(), out);
    else
      out.assign(frame.as<Pixel>());
  }

  /// Divides out the gain of the exposure from the last frame to this one.
  void compensate_exposure() {
    if (!exposure_gain_) exposure_gain_.emplace(format().bits, current_.linear_light);
    const double gain = exposure_gain_->between(last_.view(), now_.view(), threads());
    const double total = gain_ * gain;
    if (gain == 1 || std::max(total, 1 / total) > max_total_gain) return;
    gain_ = total;
    plans_.clear_tables();
    responses_ = responses_to_luma(current_);
    if (current_.upsampling == Upsampling::linear) return;
    expose(last_, format().bits, current_.linear_light, gain, threads());
    frame_flow_.forget();  // its copy has the old exposure
  }

  /// Returns the duration of the interval in microseconds.
  double begin(const StepTimes& interval, EventBuckets& events) {
    keep_causes();
    if (settings_ != current_) change_to(settings_);
    if (current_.max_rate > 0 && !readout_) readout_.emplace(format().width, format().height);
    const double duration = in_microseconds(interval.duration());
    const auto rounding_of = [](Nanoseconds time) { return in_microseconds(time % 1000); };
    next_rounding_ =
        std::max(0.0, rounding_of(*last_time_ + interval.duration()) - rounding_of(*last_time_));
    fired_.begin(duration, band_count(format().height), readout_ ? unread_ : events);
    scratch_.resize(static_cast<std::size_t>(threads().threads()));
    return duration;
  }

  /// Starts or stops finding the causes of events.
  void keep_causes() {
    if (has_labels() == pixels_.keeps_causes()) return;
    pixels_.keep_causes(has_labels());
    if (has_labels()) return;
    fired_.drop_causes();
    if (readout_) readout_->drop_causes();
  }

  void finish(double duration, EventBuckets& events) {
    plans_.end();
    clock_ += duration;
    if (!readout_) return;
    const bool is_limited = current_.max_rate > 0;
    sorted_.resize(unread_.size());
    unread_.write_to(sorted_.data(), threads());
    readout_->read(sorted_, duration, is_limited ? current_.max_rate : unlimited, events);
    if (!is_limited) readout_.reset();  // no events are waiting any more
  }

  /// Advances all pixels with linear interpolation.
  void advance_straight(double duration, bool is_exposed) {
    frame_flow_.forget();  // does not see this frame
    begin_plans(duration, 1, is_exposed);
    const bool is_widened = luma_bits(current_) != format().bits;
    for_each_band([&](const BandRows& rows, Scratch& scratch, const IntervalEvents::Band& events) {
      for (int y = rows.first; y < rows.last; ++y) {
        const void* luma = now_.row(y);
        if (is_widened) {
          widen(now_.row(y), format().width, scratch.luma.data());
          luma = scratch.luma.data();
        }
        const Run run{y, 0, format().width};
        const PixelRow pixels = pixels_.row(y);
        for (std::size_t i = 0; i < plans_.at(1).sub_intervals.size(); ++i)
          advance_run({luma, luma}, run, pixels, plans_.at(1), i, scratch, events);
      }
    });
  }

  void advance_along_motion(double duration) {
    const auto flow = find_flow();
    const int max_steps = current_.max_interpolated_frames + 1;
    tiles_.measure(last_.view(), now_.view(), flow, max_steps, threads());
    begin_plans(duration, max_steps, true);
    for (int row = 0; row < tiles_.rows(); ++row)
      for (int column = 0; column < tiles_.columns(); ++column)
        plans_.make(tiles_.at(column, row).steps);
    for_each_band([&](const BandRows& rows, Scratch& scratch, const IntervalEvents::Band& events) {
      scratch.moving.resize(static_cast<std::size_t>(max_steps) * moving_stride);
      for (int top = rows.first; top < rows.last; top += MotionTiles::height) {
        const auto tile_at = [&](int x) -> const MotionTiles::Tile& {
          return tiles_.at(x / MotionTiles::width, top / MotionTiles::height);
        };
        // Row by row, which leaves the events of a microsecond nearly in raster order.
        for (int y = top; y < std::min(top + MotionTiles::height, rows.last); ++y) {
          const PixelRow pixels = pixels_.row(y);
          widen(now_.row(y), format().width, scratch.luma.data());
          Run run{y, 0, 0};  // of tiles with these steps
          int steps = 1;
          for (int left = 0; left < format().width; left += MotionTiles::width) {
            const auto& tile = tile_at(left);
            const int right = std::min(left + MotionTiles::width, format().width);
            const bool is_skipped = try_skip({y, left, right}, pixels, tile, scratch);
            const bool is_full = steps > 1 && run.width() == max_moving;
            if (is_skipped || is_full || tile.steps != steps) {
              advance_moving(run, pixels, steps, flow, scratch, events);
              run.first = is_skipped ? right : left;
              steps = tile.steps;
            }
            run.last = right;
          }
          advance_moving(run, pixels, steps, flow, scratch, events);
        }
      }
    });
  }

  /// Advances a run of a tile that moves through the interval if none of its pixels can fire.
  /// Otherwise returns false.
  bool try_skip(const Run& run, const PixelRow& pixels, const MotionTiles::Tile& tile,
                const Scratch& scratch) const {
    if (tile.steps == 1 || current_.cutoff_frequency > 0 || gain_ != 1) return false;
    const void* now = scratch.luma.data() + run.first;
    return try_skip_run(filter_of(plans_.whole(), plans_.whole_tables()), range_of(tile),
                        {now, now}, pixels, run);
  }

  /// Advances a run of tiles with these steps through the interval.
  void advance_moving(const Run& run, const PixelRow& pixels, int steps,
                      const ImageView<Flow>& flow, Scratch& scratch,
                      const IntervalEvents::Band& events) {
    if (run.width() == 0) return;
    if (steps > 1)
      move_light(Warp<Pixel>{last_.view(), now_.view(), steps}, flow, run, scratch.moving.data(),
                 moving_stride);
    const void* now = scratch.luma.data() + run.first;
    const bool has_bandwidth = current_.cutoff_frequency > 0;
    const IntervalPlan& plan = plans_.at(steps);
    for (std::size_t i = 0; i < plan.sub_intervals.size(); ++i) {
      const int step = plan.sub_intervals[i].step;
      const void* luma =
          step < steps ? scratch.moving.data() + std::ptrdiff_t{step - 1} * moving_stride : now;
      advance_run({luma, has_bandwidth ? luma : now}, run, pixels, plan, i, scratch, events);
    }
  }

  LightRange range_of(const MotionTiles::Tile& tile) const {
    const auto response = [this](int luma) {
      const int white = static_cast<int>(responses_.size()) - 1;
      return responses_[static_cast<std::size_t>(std::min(luma * widening(current_), white))];
    };
    return {response(tile.darkest), response(tile.brightest), plans_.max_rise(), plans_.max_fall()};
  }

  void begin_plans(double duration, int max_steps, bool is_exposed) {
    plans_.begin(current_, gain_, duration, pulse_.next(current_, duration, is_exposed), max_steps);
  }

  ImageView<Flow> find_flow() {
    if (flow_) {
      frame_flow_.forget();
      return *flow_;
    }
    const Box changed = changed_box(last_.view(), now_.view(), 0);
    flow_ = frame_flow_.find(FlowMethod::dis_mq, format().bits, last_, now_, changed, threads());
    return *flow_;
  }

  RowFilter filter_of(const SubInterval& sub_interval, const ShadeTables& tables) const {
    return {sub_interval,
            tables,
            responses_,
            luma_bits(current_),
            current_.cutoff_frequency > 0,
            current_.shot_noise_rate > 0,
            gain_ != 1};
  }

  /// Advances a run of pixels through sub-interval i of a plan.
  void advance_run(const RunLuma& luma, const Run& run, const PixelRow& pixels,
                   const IntervalPlan& plan, std::size_t i, Scratch& scratch,
                   const IntervalEvents::Band& events) {
    const SubInterval& sub_interval = plan.sub_intervals[i];
    const ShadeTables& tables = *plan.tables[i];
    auto& candidates = scratch.candidates;
    candidates.count = 0;
    filter_run(filter_of(sub_interval, tables), luma, pixels, run, candidates);
    if (candidates.count == 0) return;
    const RowToSolve solved{current_,
                            dynamics_,
                            random_,
                            sub_interval,
                            tables,
                            pixels,
                            candidates,
                            events,
                            clock_ + sub_interval.begin,
                            i + 1 == plan.sub_intervals.size() ? next_rounding_ : 0};
    switch (solver_) {
      case Solver::pixels:
        return solve_pixels(solved);
      case Solver::lines:
        return solve_lines(solved);
      case Solver::varying_thresholds:
        if (current_.shot_noise_rate > 0) solve_noisy_pixels(solved, candidates);
        return solve_varying_thresholds(solved);
      case Solver::row:
        return solve_row(solved, scratch.unsolved);
    }
  }

  /// Bit depth of the luma that is passed to the pixels.
  int luma_bits(const DvsSettings& settings) const {
    const bool is_widened = settings.upsampling == Upsampling::motion && sizeof(Pixel) == 1;
    return is_widened ? 16 : format().bits;
  }

  std::vector<float> responses_to_luma(const DvsSettings& settings) const {
    return responses(settings, luma_bits(settings), is_narrow_, gain_);
  }

  /// Factor from the luma of frames to that of luma_bits().
  int widening(const DvsSettings& settings) const {
    return luma_bits(settings) == format().bits ? 1 : 257;
  }

  void adopt(const DvsSettings& settings, bool restarts) {
    const bool is_first = responses_.empty();
    const bool starts_over = is_first || !have_same_response(settings, current_);
    if (starts_over) {
      gain_ = 1;
      exposure_gain_.reset();
    }
    if (starts_over || settings.upsampling != current_.upsampling)
      responses_ = responses_to_luma(settings);
    plans_.clear_tables();
    random_ = Random(settings.seed);
    // Thresholds that events have drawn stay until time or the jitter ends.
    const bool had_jitter = current_.threshold_jitter > 0;
    const bool keeps_drawn =
        had_jitter && settings.threshold_jitter > 0 && !restarts && settings.seed == current_.seed;
    if (is_first || !have_same_traits(settings, current_) || (had_jitter && !keeps_drawn))
      for_each_row(threads(), format().height, [&](int y) {
        if (keeps_drawn)
          pixels_.change_traits(y, current_, settings, random_);
        else
          pixels_.draw_traits(y, settings, random_);
      });
    current_ = settings;
    dynamics_ = PixelDynamics(settings);
    solver_ = solver_for(settings);
  }

  /// Changes settings mid-stream. Pixels keep their state unless its units changed.
  void change_to(const DvsSettings& settings) {
    const bool is_comparable = have_same_response(settings, current_);
    const bool had_bandwidth = current_.cutoff_frequency > 0;
    adopt(settings, false);
    if (!is_comparable)
      settle();
    else if (!had_bandwidth)
      for_each_row(threads(), format().height, [&](int y) {
        const PixelRow pixels = pixels_.row(y);
        std::copy_n(pixels.target, format().width, pixels.signal);
      });
  }

  /// Settles the pixels as if the last frame had been shown for a long time.
  void settle() {
    pulse_.reset();
    const int white = static_cast<int>(responses_.size()) - 1;
    for_each_row(threads(), format().height, [&](int y) {
      float* target = pixels_.row(y).target;
      for (int x = 0; x < format().width; ++x)
        target[x] = responses_[static_cast<std::size_t>(
            std::min(last_.at(x, y) * widening(current_), white))];
      pixels_.settle(y, current_, random_);
    });
  }

  /// Calls body(rows, scratch, events) for each band of rows, in parallel.
  template <class Body>
  void for_each_band(const Body& body) {
    threads().for_each(band_count(format().height), [&](int band, int thread) {
      auto& scratch = scratch_[static_cast<std::size_t>(thread)];
      scratch.candidates.resize(format().width);
      scratch.luma.resize(static_cast<std::size_t>(format().width) + max_lanes);
      const IntervalEvents::Band events(fired_, band, scratch.added);
      body(BandRows(band, format().height), scratch, events);
      events.end();
    });
  }

  Image<Pixel> last_{format().width, format().height};
  Image<Pixel> now_{format().width, format().height};
  PixelArray pixels_{format().width, format().height};
  DvsSettings current_;  ///< applied to the pixels
  PixelDynamics dynamics_{current_};
  Solver solver_ = solver_for(current_);
  Random random_{0};
  std::optional<ExposureGain> exposure_gain_;
  double gain_ = 1;               ///< of the exposure since the first frame
  bool is_narrow_ = false;        ///< range of luma
  std::vector<float> responses_;  ///< by luma value
  ExposurePulse pulse_;
  IntervalPlans plans_;
  double clock_ = 0;          ///< start of this interval, microseconds since the first frame
  double next_rounding_ = 0;  ///< RowToSolve::next_rounding of its last sub-interval
  IntervalEvents fired_;
  EventBuckets unread_;        ///< events that go to the readout
  std::vector<Event> sorted_;  ///< the same, sorted
  std::optional<Readout> readout_;
  std::vector<Scratch> scratch_;  ///< by thread

  FrameFlow frame_flow_;
  MotionTiles tiles_;
};

}  // namespace

std::unique_ptr<DvsSimulator> make_dvs_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<PixelSimulator<std::uint16_t>>(format);
  return std::make_unique<PixelSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
