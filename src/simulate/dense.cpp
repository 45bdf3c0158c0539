// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/dense.hpp"

#include <algorithm>
#include <vector>

#include "src/picture/grey8.hpp"
#include "src/simulate/bands.hpp"
#include "src/simulate/difference.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera {
namespace {

struct Motion2 {
  Motion x;
  Motion y;
};

/// What a thread works in while it takes a band through the steps.
template <class Pixel>
struct Scratch {
  Plane<Motion2> motion;
  Plane<Pixel> before;
  Plane<Pixel> now;
};

template <class Pixel>
class InterpolatingSimulator final : public DenseSimulator {
 public:
  explicit InterpolatingSimulator(const LumaFormat& format)
      : DenseSimulator(format), last_(format.width, format.height) {}

 private:
  void start(const LumaView& frame) override { last_.assign(frame.as<Pixel>()); }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                EventBuckets& events) override {
    const auto flow = find_flow(frame);
    const Warp<Pixel> warp{last_.view(), frame.as<Pixel>(), steps.count()};
    const auto thresholds = Thresholds::of(settings, format().bits);
    const int bands = band_count(format().height);
    events.reset(steps.count(), bands);
    scratch_.resize(static_cast<std::size_t>(threads().threads()));
    threads().for_each(bands, [&](int band, int thread) {
      auto& scratch = scratch_[static_cast<std::size_t>(thread)];
      if (interpolation_ == Interpolation::forward)
        take_through<Interpolation::forward>(band, flow, warp, steps, thresholds, scratch, events);
      else
        take_through<Interpolation::blend>(band, flow, warp, steps, thresholds, scratch, events);
    });
    last_.assign(frame.as<Pixel>());
  }

  PlaneView<Flow> find_flow(const LumaView& frame) {
    if (!finder_ || finder_method_ != flow_) {
      finder_ = make_dense_flow(flow_, format().width, format().height);
      finder_method_ = flow_;
    }
    const LumaView last{format(), last_.view().data, last_.stride()};
    return finder_->find(last_grey_.of(last), grey_.of(frame), threads().threads());
  }

  /// Takes a band of rows through all steps: its pictures stay in the cache.
  template <Interpolation interpolation>
  static void take_through(int band, const PlaneView<Flow>& flow, const Warp<Pixel>& warp,
                           const StepTimes& steps, const Thresholds& thresholds,
                           Scratch<Pixel>& scratch, EventBuckets& events) {
    const int width = flow.width;
    const BandRows rows(band, flow.height);
    if (scratch.motion.width() != width)
      scratch = {Plane<Motion2>(width, rows_per_band), Plane<Pixel>(width, rows_per_band),
                 Plane<Pixel>(width, rows_per_band)};
    for (int y = rows.first; y < rows.last; ++y) {
      const Flow* in = flow.row(y);
      Motion2* out = scratch.motion.row(y - rows.first);
      for (int x = 0; x < width; ++x)
        out[x] = {motion_per_step(in[x].x, steps.count()), motion_per_step(in[x].y, steps.count())};
      std::copy_n(warp.last.row(y), width, scratch.before.row(y - rows.first));
    }
    for (int j = 1; j <= steps.count(); ++j) {
      auto& out = events.bucket(j, band);
      const auto t = steps.microseconds(j);
      for (int y = rows.first; y < rows.last; ++y) {
        const Motion2* motion = scratch.motion.row(y - rows.first);
        Pixel* before = scratch.before.row(y - rows.first);
        const Pixel* now = warp.now.row(y);
        if (j < steps.count()) {
          Pixel* between = scratch.now.row(y - rows.first);
          for (int x = 0; x < width; ++x)
            between[x] = warp.template at<interpolation>(x, y, motion[x].x, motion[x].y, j);
          now = between;
        }
        fire_differences(before, now, width, y, t, thresholds, out);
      }
      std::swap(scratch.before, scratch.now);
    }
  }

  Plane<Pixel> last_;
  std::unique_ptr<DenseFlow> finder_;
  FlowMethod finder_method_{};
  Grey8 last_grey_;
  Grey8 grey_;
  std::vector<Scratch<Pixel>> scratch_;  // one a thread
};

}  // namespace

std::unique_ptr<DenseSimulator> make_dense_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<InterpolatingSimulator<std::uint16_t>>(format);
  return std::make_unique<InterpolatingSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
