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
#include "src/dvs/pixel_solver.hpp"
#include "src/dvs/readout.hpp"
#include "src/flow/region_of_interest_flow.hpp"
#include "src/simulate/difference.hpp"
#include "src/simulate/interpolation.hpp"

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
         a.response == b.response && a.log_eps == b.log_eps;
}

/// Limit of the gain since the first frame, in case many estimates err in the same direction.
constexpr double max_total_gain = 64;

/// Event rate limit that no array reaches, events per second.
constexpr double unlimited = 1e18;

/// Scratch memory of a thread.
struct alignas(64) Scratch {
  Candidates candidates;
  UnsolvedPixels unsolved;
  std::vector<std::uint16_t> luma;  ///< a row, padded for vectors
};

template <class Pixel>
class PixelSimulator final : public DvsSimulator {
 public:
  explicit PixelSimulator(const LumaFormat& format) : DvsSimulator(format) {}

 private:
  void start(const LumaView& frame) override {
    keep(frame, last_);
    finder_.reset();
    sub_interval_count_ = 0;
    clock_ = 0;
    fired_.reset();
    if (readout_) readout_->reset();
    if (gain_ != 1) responses_.clear();  // of another exposure
    adopt(settings_);
    settle();
  }

  void simulate(const LumaView& frame, const StepTimes& interval, const Settings&,
                EventBuckets& events) override {
    keep(frame, now_);
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

  void keep(const LumaView& frame, Image<Pixel>& kept) {
    const int white = (1 << format().bits) - 1;
    const int limit = static_cast<int>(std::lround(settings_.denoise / 255 * white));
    if (limit > 0)
      denoise(frame.as<Pixel>(), limit, threads(), kept);
    else
      kept.assign(frame.as<Pixel>());
  }

  /// Divides out the gain of the exposure from the last frame to this one.
  void compensate_exposure() {
    if (!exposure_gain_) exposure_gain_.emplace(format().bits, current_.linear_light);
    const double gain = exposure_gain_->between(last_.view(), now_.view(), threads());
    const double total = gain_ * gain;
    if (gain == 1 || std::max(total, 1 / total) > max_total_gain) return;
    gain_ = total;
    responses_ = responses(current_, luma_bits(current_), gain_);
    if (current_.upsampling == Upsampling::linear) return;
    expose(last_, format().bits, current_.linear_light, gain, threads());
    finder_.reset();  // knows it as it was
  }

  /// Returns the duration of the interval in microseconds.
  double begin(const StepTimes& interval, EventBuckets& events) {
    if (settings_ != current_) change_to(settings_);
    if (current_.max_rate > 0 && !readout_) readout_.emplace(format().width, format().height);
    const double duration = in_microseconds(interval.duration());
    fired_.begin(duration, band_count(format().height), readout_ ? unread_ : events);
    scratch_.resize(static_cast<std::size_t>(threads().threads()));
    return duration;
  }

  void finish(double duration, EventBuckets& events) {
    sub_interval_count_ += sub_intervals_.size();
    clock_ += duration;
    if (!readout_) return;
    const bool is_limited = current_.max_rate > 0;
    sorted_.resize(unread_.size());
    unread_.write_to(sorted_.data(), threads());
    readout_->pass(sorted_, duration, is_limited ? current_.max_rate : unlimited, events);
    if (!is_limited) readout_.reset();  // no events are waiting any more
  }

  /// Advances all pixels with linear interpolation.
  void advance_straight(double duration, bool is_exposed) {
    finder_.reset();  // its last frame is outdated
    plan(duration, 1, is_exposed);
    const bool is_widened = luma_bits(current_) != format().bits;
    for_each_band([&](const BandRows& rows, Scratch& scratch, const BandEvents& events) {
      for (int y = rows.first; y < rows.last; ++y) {
        const void* luma = now_.row(y);
        if (is_widened) {
          widen_row(now_.row(y), format().width, scratch.luma.data());
          luma = scratch.luma.data();
        }
        for (const auto& sub_interval : sub_intervals_)
          advance_row(luma, y, sub_interval, scratch, events);
      }
    });
  }

  void advance_along_motion(double duration) {
    const auto flow = find_flow();
    const int steps = std::clamp(steps_of(flow), 1, current_.max_interpolated_frames + 1);
    plan(duration, steps, true);
    const Warp<Pixel> warp{last_.view(), now_.view(), steps};
    for_each_band([&](const BandRows& rows, Scratch& scratch, const BandEvents& events) {
      for (const auto& sub_interval : sub_intervals_) {
        for (int y = rows.first; y < rows.last; ++y) {
          if (sub_interval.step < steps)
            interpolate_row(warp, flow, y, sub_interval.step, scratch.luma.data());
          else
            widen_row(now_.row(y), format().width, scratch.luma.data());
          advance_row(scratch.luma.data(), y, sub_interval, scratch, events);
        }
      }
    });
  }

  /// Prepares the sub-intervals and tables of the next interval, which all pixels share.
  void plan(double duration, int steps, bool is_exposed) {
    divide_interval(duration, steps, pulse_.next(current_, duration, is_exposed),
                    sub_interval_count_, sub_intervals_);
    tables_.clear();
    for (const auto& sub_interval : sub_intervals_)
      if (tables_for(sub_interval) == tables_.end())
        tables_.emplace_back(current_, sub_interval.duration, gain_);
  }

  auto tables_for(const SubInterval& sub_interval) const {
    return std::ranges::find(tables_, sub_interval.duration, &ShadeTables::duration);
  }

  ImageView<Flow> find_flow() {
    if (!finder_) finder_.emplace(FlowMethod::dis_lq, format().width, format().height);
    const auto luma = [this](const Image<Pixel>& frame) {
      return LumaView{format(), frame.view().data, frame.stride()};
    };
    const Box changed = changed_box(last_.view(), now_.view(), 0);
    return finder_->find(last_grey_.of(luma(last_)), grey_.of(luma(now_)), changed, threads());
  }

  /// Returns the number of steps needed for motions of at most one pixel per step.
  int steps_of(const ImageView<Flow>& flow) {
    const int bands = band_count(format().height);
    max_squares_.assign(static_cast<std::size_t>(bands), 0);
    threads().for_each(bands, [&](int band, int) {
      const BandRows rows(band, format().height);
      float max_square = 0;
      for (int y = rows.first; y < rows.last; ++y) {
        const Flow* row = flow.row(y);
        for (int x = 0; x < flow.width; ++x)
          max_square = std::max(max_square, row[x].x * row[x].x + row[x].y * row[x].y);
      }
      max_squares_[static_cast<std::size_t>(band)] = max_square;
    });
    const float max_square = *std::max_element(max_squares_.begin(), max_squares_.end());
    return static_cast<int>(
        std::ceil(std::sqrt(std::min<double>(max_square, max_side * max_side))));
  }

  void advance_row(const void* luma, int y, const SubInterval& sub_interval, Scratch& scratch,
                   const BandEvents& events) {
    const ShadeTables& tables = *tables_for(sub_interval);
    auto& candidates = scratch.candidates;
    candidates.count = 0;
    const PixelRow pixels = pixels_.row(y);
    filter_row({sub_interval, tables, responses_, luma_bits(current_),
                current_.cutoff_frequency > 0, current_.shot_noise_rate > 0, gain_ != 1},
               luma, pixels, format().width, candidates);
    const RowToSolve solved{current_, random_,    sub_interval, tables,
                            pixels,   candidates, events,       clock_ + sub_interval.begin};
    switch (solver_for(current_)) {
      case Solver::pixels:
        return solve_pixels(solved);
      case Solver::lines:
        return solve_lines(solved);
      case Solver::adaptive_lines:
        return solve_adaptive_lines(solved);
      case Solver::row:
        return solve_row(solved, scratch.unsolved);
    }
  }

  /// Bit depth of the luma that is passed to the pixels.
  int luma_bits(const DvsSettings& settings) const {
    const bool is_widened = settings.upsampling == Upsampling::motion && sizeof(Pixel) == 1;
    return is_widened ? 16 : format().bits;
  }

  void adopt(const DvsSettings& settings) {
    const bool is_first = responses_.empty();
    const bool starts_over = is_first || !have_same_response(settings, current_);
    if (starts_over) {
      gain_ = 1;
      exposure_gain_.reset();
    }
    if (starts_over || settings.upsampling != current_.upsampling)
      responses_ = responses(settings, luma_bits(settings), gain_);
    random_ = Random(settings.seed);
    if (is_first || !have_same_traits(settings, current_) || current_.threshold_jitter > 0)
      for_each_row(threads(), format().height,
                   [&](int y) { pixels_.draw_traits(y, settings, random_); });
    current_ = settings;
  }

  /// Changes settings mid-stream. Pixels keep their state unless its units changed.
  void change_to(const DvsSettings& settings) {
    const bool is_comparable = have_same_response(settings, current_);
    const bool had_bandwidth = current_.cutoff_frequency > 0;
    adopt(settings);
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
    const int widening = luma_bits(current_) == format().bits ? 1 : 257;
    const int white = static_cast<int>(responses_.size()) - 1;
    for_each_row(threads(), format().height, [&](int y) {
      float* target = pixels_.row(y).target;
      for (int x = 0; x < format().width; ++x)
        target[x] =
            responses_[static_cast<std::size_t>(std::min(last_.at(x, y) * widening, white))];
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
      body(BandRows(band, format().height), scratch, BandEvents{fired_, band});
    });
  }

  Image<Pixel> last_{format().width, format().height};
  Image<Pixel> now_{format().width, format().height};
  PixelArray pixels_{format().width, format().height};
  DvsSettings current_;  ///< applied to the pixels
  Random random_{0};
  std::optional<ExposureGain> exposure_gain_;
  double gain_ = 1;               ///< of the exposure since the first frame
  std::vector<float> responses_;  ///< by luma value
  ExposurePulse pulse_;
  std::vector<SubInterval> sub_intervals_;  ///< of the current interval, in order of time
  std::vector<ShadeTables> tables_;         ///< one per duration of sub-intervals
  std::uint64_t sub_interval_count_ = 0;    ///< before this interval
  double clock_ = 0;                        ///< its start, microseconds since the first frame
  IntervalEvents fired_;
  EventBuckets unread_;        ///< events that go to the readout
  std::vector<Event> sorted_;  ///< the same, sorted
  std::optional<Readout> readout_;
  std::vector<Scratch> scratch_;  ///< by thread

  std::optional<RegionOfInterestFlow> finder_;
  Grey8 last_grey_;
  Grey8 grey_;
  std::vector<float> max_squares_;  ///< maximum squared length of the flow, by band
};

}  // namespace

std::unique_ptr<DvsSimulator> make_dvs_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<PixelSimulator<std::uint16_t>>(format);
  return std::make_unique<PixelSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
