// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/dvs_simulator.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "src/core/grey8.hpp"
#include "src/core/rows.hpp"
#include "src/dvs/denoise.hpp"
#include "src/dvs/event_collector.hpp"
#include "src/dvs/exposure_pulse.hpp"
#include "src/dvs/light_response.hpp"
#include "src/dvs/passages.hpp"
#include "src/dvs/pixel_array.hpp"
#include "src/dvs/pixel_solver.hpp"
#include "src/dvs/readout.hpp"
#include "src/dvs/row_filter.hpp"
#include "src/flow/region_of_interest_flow.hpp"
#include "src/simulate/bands.hpp"
#include "src/simulate/difference.hpp"
#include "src/simulate/interpolated_row.hpp"

namespace eventcamera {
namespace {

/// Whether the pixels are as different from each other under both.
bool have_same_traits(const DvsSettings& a, const DvsSettings& b) {
  return a.positive_threshold == b.positive_threshold &&
         a.negative_threshold == b.negative_threshold && a.threshold_sigma == b.threshold_sigma &&
         a.leak_rate_hz == b.leak_rate_hz && a.leak_spread == b.leak_spread &&
         a.hot_pixels == b.hot_pixels && a.dead_pixels == b.dead_pixels && a.seed == b.seed;
}

bool have_same_response(const DvsSettings& a, const DvsSettings& b) {
  return a.linear_light == b.linear_light && a.response == b.response && a.log_eps == b.log_eps;
}

/// Events a second that no readout is too slow for.
constexpr double unlimited = 1e18;

/// What a thread needs while it is at work.
struct alignas(64) Scratch {
  Candidates candidates;
  std::vector<std::uint16_t> luma;
};

template <class Pixel>
class PixelSimulator final : public DvsSimulator {
 public:
  explicit PixelSimulator(const LumaFormat& format)
      : DvsSimulator(format),
        last_(format.width, format.height),
        now_(format.width, format.height),
        pixels_(format.width, format.height) {}

 private:
  void start(const LumaView& frame) override {
    keep(frame, last_);
    finder_.reset();
    segments_ = 0;
    order_.reset();
    if (readout_) readout_->reset();
    adopt(settings_);
    settle();
  }

  void simulate(const LumaView& frame, const StepTimes& interval, const Settings&,
                EventBuckets& events) override {
    keep(frame, now_);
    const double duration = begin(interval);
    if (current_.upsampling == Upsampling::motion)
      pass_along_motion(duration);
    else
      pass_straight(duration, true);
    finish(duration, events);
    std::swap(last_, now_);
  }

  bool hold(const StepTimes& interval, const Settings&, EventBuckets& events) override {
    now_.assign(last_.view());
    const double duration = begin(interval);
    pass_straight(duration, false);
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

  /// Returns the duration of the interval, microseconds.
  double begin(const StepTimes& interval) {
    if (settings_ != current_) change_to(settings_);
    const double duration = static_cast<double>(interval.duration()) / 1000;
    order_.begin(duration, band_count(format().height));
    scratch_.resize(static_cast<std::size_t>(threads().threads()));
    return duration;
  }

  void finish(double duration, EventBuckets& events) {
    segments_ += passages_.size();
    const bool is_limited = current_.max_event_rate > 0;
    if (!is_limited && !readout_) {
      order_.finish(events, threads());
      return;
    }
    if (!readout_) readout_.emplace(format().width, format().height);
    order_.finish(ordered_, threads());
    readout_->pass(ordered_, duration, is_limited ? current_.max_event_rate : unlimited, events);
    if (!is_limited) readout_.reset();  // now that nothing waits in it
  }

  void pass_straight(double duration, bool is_exposed) {
    finder_.reset();  // what it knows is not the last frame any more
    plan(duration, 1, is_exposed);
    for_each_band([&](const BandRows& rows, Scratch& scratch, EventCollector& collector) {
      scratch.luma.resize(static_cast<std::size_t>(format().width));
      for (int y = rows.first; y < rows.last; ++y) {
        const bool is_ready = luma_bits(current_) == format().bits;
        if (!is_ready) widen_row(now_.row(y), format().width, scratch.luma.data());
        for (std::size_t i = 0; i < passages_.size(); ++i) {
          if (is_ready)
            pass_row_of_luma(now_.row(y), y, i, scratch, collector);
          else
            pass_row_of_luma(scratch.luma.data(), y, i, scratch, collector);
        }
      }
    });
  }

  void pass_along_motion(double duration) {
    const auto flow = find_flow();
    const int steps = std::clamp(steps_of(flow), 1, current_.max_steps);
    plan(duration, steps, true);
    const Warp<Pixel> warp{last_.view(), now_.view(), steps};
    for_each_band([&](const BandRows& rows, Scratch& scratch, EventCollector& collector) {
      scratch.luma.resize(static_cast<std::size_t>(format().width));
      for (std::size_t i = 0; i < passages_.size(); ++i) {
        const int step = passages_[i].step;
        for (int y = rows.first; y < rows.last; ++y) {
          if (step < steps)
            interpolate_row(warp, flow, y, step, scratch.luma.data());
          else
            widen_row(now_.row(y), format().width, scratch.luma.data());
          pass_row_of_luma(scratch.luma.data(), y, i, scratch, collector);
        }
      }
    });
  }

  /// What is the same for all pixels in the interval to come.
  void plan(double duration, int steps, bool is_exposed) {
    cut_into_passages(duration, steps, pulse_.next(current_, duration, is_exposed), passages_);
    tables_.clear();
    table_of_.clear();
    for (const auto& passage : passages_) {
      const auto same = std::find_if(passages_.begin(), passages_.end(), [&](const auto& other) {
        return other.duration == passage.duration;
      });
      const auto before = static_cast<std::size_t>(same - passages_.begin());
      if (before < table_of_.size()) {
        table_of_.push_back(table_of_[before]);
      } else {
        table_of_.push_back(tables_.size());
        tables_.emplace_back(current_, passage.duration);
      }
    }
  }

  ImageView<Flow> find_flow() {
    if (!finder_) finder_.emplace(FlowMethod::dis_lq, format().width, format().height);
    const auto luma = [this](const Image<Pixel>& frame) {
      return LumaView{format(), frame.view().data, frame.stride()};
    };
    const Box changed = changed_box(last_.view(), now_.view(), 0);
    return finder_->find(last_grey_.of(luma(last_)), grey_.of(luma(now_)), changed, threads());
  }

  /// With which nothing moves by more than a pixel.
  int steps_of(const ImageView<Flow>& flow) {
    const int bands = band_count(format().height);
    farthest_.assign(static_cast<std::size_t>(bands), 0);
    threads().for_each(bands, [&](int band, int) {
      const BandRows rows(band, format().height);
      float farthest = 0;
      for (int y = rows.first; y < rows.last; ++y) {
        const Flow* row = flow.row(y);
        for (int x = 0; x < flow.width; ++x)
          farthest = std::max(farthest, row[x].x * row[x].x + row[x].y * row[x].y);
      }
      farthest_[static_cast<std::size_t>(band)] = farthest;
    });
    const float farthest = *std::max_element(farthest_.begin(), farthest_.end());
    return static_cast<int>(std::ceil(std::sqrt(std::min<double>(farthest, max_side * max_side))));
  }

  template <class Luma>
  void pass_row_of_luma(const Luma* luma, int y, std::size_t which, Scratch& scratch,
                        EventCollector& collector) {
    const Passage& passage = passages_[which];
    const ShadeTables& tables = tables_[table_of_[which]];
    const Segment segment{passage.begin, passage.duration, segments_ + which, passage.rise};
    const Screen screen{*response_,
                        tables,
                        luma_bits(current_),
                        static_cast<float>(passage.duration),
                        static_cast<float>(passage.share),
                        static_cast<float>(passage.rise),
                        current_.cutoff_hz > 0,
                        current_.shot_noise_rate_hz > 0};
    auto& candidates = scratch.candidates;
    candidates.clear();
    pass_row(screen, luma, y, pixels_, candidates);
    PixelTime(current_, random_, segment).pass(pixels_, y, candidates, tables, collector);
  }

  /// Of the luma that the pixels are shown.
  int luma_bits(const DvsSettings& settings) const {
    const bool is_widened = settings.upsampling == Upsampling::motion && sizeof(Pixel) == 1;
    return is_widened ? 16 : format().bits;
  }

  void adopt(const DvsSettings& settings) {
    const bool is_first = !response_;
    if (is_first || !have_same_response(settings, current_) ||
        settings.upsampling != current_.upsampling)
      response_.emplace(settings, luma_bits(settings));
    random_ = Random(settings.seed);
    if (is_first || !have_same_traits(settings, current_) || current_.threshold_jitter > 0)
      for_each_row(threads(), format().height,
                   [&](int y) { pixels_.draw_traits(y, settings, random_); });
    current_ = settings;
  }

  /// In the midst of a video: the pixels keep what they remember, unless it was in other units.
  void change_to(const DvsSettings& settings) {
    const bool is_comparable = have_same_response(settings, current_);
    const bool had_bandwidth = current_.cutoff_hz > 0;
    adopt(settings);
    if (!is_comparable)
      settle();
    else if (!had_bandwidth)
      for_each_row(threads(), format().height, [&](int y) {
        for (int x = 0; x < format().width; ++x) pixels_.signal.at(x, y) = pixels_.target.at(x, y);
      });
  }

  /// The last frame has always been there.
  void settle() {
    pulse_.reset();
    const int widening = luma_bits(current_) == format().bits ? 1 : 257;
    for_each_row(threads(), format().height, [&](int y) {
      for (int x = 0; x < format().width; ++x)
        pixels_.target.at(x, y) =
            response_->values()[std::min(last_.at(x, y) * widening, response_->white())];
      pixels_.settle(y, current_, random_);
    });
  }

  template <class Body>
  void for_each_band(const Body& body) {
    threads().for_each(band_count(format().height), [&](int band, int thread) {
      EventCollector collector(order_, band);
      body(BandRows(band, format().height), scratch_[static_cast<std::size_t>(thread)], collector);
    });
  }

  Image<Pixel> last_;
  Image<Pixel> now_;
  PixelArray pixels_;
  DvsSettings current_;  ///< what the pixels are made for
  Random random_{0};
  std::optional<LightResponse> response_;
  ExposurePulse pulse_;
  std::vector<Passage> passages_;      ///< of the interval, in the order of time
  std::vector<ShadeTables> tables_;    ///< for each duration of a passage
  std::vector<std::size_t> table_of_;  ///< of each passage
  std::uint64_t segments_ = 0;         ///< that have passed
  EventOrder order_;
  EventBuckets ordered_;
  std::optional<Readout> readout_;
  std::vector<Scratch> scratch_;  ///< thread by thread

  std::optional<RegionOfInterestFlow> finder_;
  Grey8 last_grey_;
  Grey8 grey_;
  std::vector<float> farthest_;  ///< that something moves, squared, band by band
};

}  // namespace

std::unique_ptr<DvsSimulator> make_dvs_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<PixelSimulator<std::uint16_t>>(format);
  return std::make_unique<PixelSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
