// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/dvs_simulator.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "src/core/luma.hpp"
#include "src/core/thread_pool.hpp"
#include "src/dvs/frame_pair.hpp"
#include "src/dvs/interval_events.hpp"
#include "src/dvs/light_response.hpp"
#include "src/dvs/moving_light.hpp"
#include "src/dvs/pixel_array.hpp"
#include "src/dvs/pixel_solver.hpp"
#include "src/dvs/row_filter.hpp"
#include "src/dvs/sub_intervals.hpp"

namespace eventcamera {
namespace {

struct alignas(64) Scratch {
  RowToSolve row;
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
  double denoise_setting(const Settings&) const override { return settings_.denoise; }

  bool needs_flow() const override { return settings_.upsampling == Upsampling::motion; }

  void start(const LumaView& frame) override {
    response_.set_range(frame.is_narrow);
    frames_.start(frame.as<Pixel>());
    timeline_.restart();
    fired_.restart();
    response_.restart();
    response_.set(settings_);
    set_labels();
    pixels_.start(settings_, threads());
    settle();
  }

  void simulate(const LumaView& frame, const StepTimes& interval, const Settings& settings,
                StepBuckets& events) override {
    response_.set_range(frame.is_narrow);
    frames_.now.assign(frame.as<Pixel>());
    change_settings();
    frames_.prepare(settings_, response_, interval.duration(), flow_, threads(), [&] { settle(); });
    begin(interval, true, settings);
    if (needs_flow())
      advance_along_motion();
    else
      advance_straight();
    end(events);
    frames_.advance();
  }

  bool hold(const StepTimes& interval, const Settings& settings, StepBuckets& events) override {
    change_settings();
    frames_.hold();
    begin(interval, false, settings);
    advance_straight();
    end(events);
    return true;
  }

  const EventBuckets& events(Nanoseconds, const Settings&) override { return *made_; }

  std::optional<Nanoseconds> latest() const override { return fired_.latest(); }

  const EventBuckets& late(Nanoseconds duration) override {
    fired_.begin(in_microseconds(duration), settings_.max_rate, 0);
    for_each_row([](int, Scratch&) {});
    return fired_.end(events_, threads());
  }

  void label(const LabelledEvents& events) override { separate_causes(events); }

  void settle() { pixels_.settle(frames_.last, response_, threads()); }

  void set_labels() {
    if (has_labels() == pixels_.has_labels()) return;
    pixels_.set_labels(has_labels());
    if (!has_labels()) fired_.drop_causes();
  }

  /// Applies new settings mid-stream. Pixels keep their state unless its units change.
  void change_settings() {
    set_labels();
    if (settings_ == pixels_.model().settings) return;
    const bool keeps_units = response_.has_units_of(settings_);
    response_.set(settings_);
    pixels_.change(settings_, threads());
    if (keeps_units) return;
    timeline_.end_pulse();
    settle();
  }

  void begin(const StepTimes& interval, bool is_exposed, const Settings& settings) {
    timeline_.begin(settings_, response_.gain(), *last_time_, interval.duration(), is_exposed);
    fired_.begin(timeline_.duration(), settings_.max_rate, settings.rolling_shutter);
    scratch_.resize(threads().threads());
  }

  void end(StepBuckets& read) {
    timeline_.end();
    made_ = &fired_.end(read, threads());
  }

  /// Advances all pixels with linear interpolation.
  void advance_straight() {
    for_each_row([&](int y, Scratch& scratch) {
      const void* luma = response_.is_widened() ? widened(y, scratch)
                                                : static_cast<const void*>(frames_.now.row(y));
      for (const auto& sub_interval : timeline_.plan(1))
        advance({y, 0, format().width}, sub_interval, {luma, luma}, scratch.row);
    });
  }

  /// Row by row: the events of one microsecond are nearly in raster order.
  void advance_along_motion() {
    const ImageView<Flow>& flow = *flow_;
    const int max_steps = settings_.max_interpolated_frames + 1;
    tiles_.measure(flow, max_steps, threads());
    for (int row = 0; row < tiles_.rows(); ++row)
      for (int column = 0; column < tiles_.columns(); ++column)
        timeline_.make_plan(tiles_.steps(column, row));
    for_each_row([&](int y, Scratch& scratch) {
      scratch.moving.resize(static_cast<std::size_t>(max_steps) * moving_stride);
      widened(y, scratch);
      for (Run run{y, 0, 0}; run.first < format().width; run.first = run.last) {
        const int steps = extend_over_tiles(run);
        advance_moving(run, steps, flow, scratch);
      }
    });
  }

  /// Extends an empty run over the tiles with as many steps as the first one. Returns that number.
  int extend_over_tiles(Run& run) const {
    const auto steps_at = [&](int x) {
      return tiles_.steps(x / MotionTiles::width, run.y / MotionTiles::height);
    };
    const int steps = steps_at(run.first);
    const int end = steps > 1 ? std::min(run.first + max_moving, format().width) : format().width;
    while (run.last < end && steps_at(run.last) == steps) run.last += MotionTiles::width;
    run.last = std::min(run.last, format().width);
    return steps;
  }

  void advance_moving(const Run& run, int steps, const ImageView<Flow>& flow, Scratch& scratch) {
    if (steps > 1)
      move_light(Warp<Pixel>{frames_.last.view(), frames_.now.view(), steps}, flow, run,
                 scratch.moving.data(), moving_stride);
    const std::uint16_t* now = scratch.luma.data() + run.first;
    const bool has_bandwidth = pixels_.model().has_bandwidth();
    for (const auto& sub_interval : timeline_.plan(steps)) {
      const int step = sub_interval.step;
      const std::uint16_t* luma =
          step < steps ? scratch.moving.data() + std::ptrdiff_t{step - 1} * moving_stride : now;
      advance(run, sub_interval, {luma, has_bandwidth ? luma : now}, scratch.row);
    }
  }

  void advance(const Run& run, const SubInterval& sub_interval, const RunLuma& luma,
               RowToSolve& row) const {
    row.candidates.count = 0;
    filter_run(pixels_.model(), response_, sub_interval, luma, row.pixels, run, row.candidates);
    if (row.candidates.count == 0) return;
    row.sub_interval = &sub_interval;
    switch (row.model->solver) {
      case Solver::pixels:
        return solve_pixels(row);
      case Solver::lines:
        return solve_lines(row);
      case Solver::row:
        return solve_row(row);
    }
  }

  /// The luma of a row of the frame, with the depth of move_light().
  const std::uint16_t* widened(int y, Scratch& scratch) const {
    widen(frames_.now.row(y), format().width, scratch.luma.data());
    return scratch.luma.data();
  }

  /// Calls advance_row(y, scratch) for each row, band by band in parallel.
  template <class AdvanceRow>
  void for_each_row(const AdvanceRow& advance_row) {
    threads().for_each(band_count(format().height), [&](int band, int thread) {
      auto& scratch = scratch_[thread];
      auto& row = scratch.row;
      row.model = &pixels_.model();
      row.events.begin(fired_, band);
      row.candidates.resize(format().width);
      scratch.luma.resize(static_cast<std::size_t>(format().width) + max_lanes);
      const BandRows rows(band, format().height);
      for (int y = rows.first; y < rows.last; ++y) {
        row.pixels = pixels_.row(y);
        advance_row(y, scratch);
      }
      row.events.end();
    });
  }

  FramePair<Pixel> frames_{format()};
  LightResponse response_{format().bits};
  PixelArray pixels_{format().width, format().height};
  Timeline timeline_;
  IntervalEvents fired_{format().width, format().height};
  const EventBuckets* made_ = nullptr;  ///< by the last interval
  MotionTiles tiles_;
  std::vector<Scratch> scratch_;  ///< by thread
};

}  // namespace

std::unique_ptr<DvsSimulator> make_dvs_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<PixelSimulator<std::uint16_t>>(format);
  return std::make_unique<PixelSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
