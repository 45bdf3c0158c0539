// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/simulators.hpp"

#include <algorithm>
#include <utility>

#include "src/simulate/difference.hpp"
#include "src/simulate/frame_flow.hpp"
#include "src/simulate/interpolation.hpp"

namespace eventcamera {
namespace {

template <class Pixel>
class InterpolatingSimulator final : public DenseSimulator {
 public:
  explicit InterpolatingSimulator(const LumaFormat& format)
      : DenseSimulator(format),
        last_(format.width, format.height),
        now_(format.width, format.height) {}

 private:
  bool needs_flow() const override { return true; }

  void start(const LumaView& frame) override {
    last_.assign(frame.as<Pixel>());
    frame_flow_.forget();
  }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                StepBuckets& events) override {
    now_.assign(frame.as<Pixel>());
    const auto thresholds = Thresholds::of(settings, format().bits);
    if (flow_) {
      frame_flow_.forget();
    } else {
      // Only pixels that changed by more than a threshold can fire: others need no flow.
      const Box changed = changed_box(last_.view(), now_.view(),
                                      std::min(thresholds.positive, thresholds.negative));
      flow_ = frame_flow_.find(method_, format().bits, last_, now_, changed, threads());
    }
    kernel_.fire(
        InterpolatedInterval<Pixel>{
            {last_.view(), now_.view(), steps.count()}, *flow_, interpolation_, steps, thresholds},
        threads(), events);
    std::swap(last_, now_);
  }

  Image<Pixel> last_;
  Image<Pixel> now_;
  InterpolationKernel kernel_;
  FrameFlow frame_flow_;
};

}  // namespace

std::unique_ptr<DenseSimulator> make_dense_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<InterpolatingSimulator<std::uint16_t>>(format);
  return std::make_unique<InterpolatingSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
