// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/dense.hpp"

#include <utility>

#include "src/picture/grey8.hpp"
#include "src/simulate/path.hpp"

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
  void start(const LumaView& frame) override {
    last_.assign(frame.as<Pixel>());
    finder_.reset();
  }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                EventBuckets& events) override {
    now_.assign(frame.as<Pixel>());
    const Path<Pixel> path{{last_.view(), now_.view(), steps.count()},
                           find_flow(),
                           interpolation_,
                           steps,
                           Thresholds::of(settings, format().bits)};
    walker_.fire(path, threads(), events);
    std::swap(last_, now_);
  }

  PlaneView<Flow> find_flow() {
    const auto push = [this](const Plane<Pixel>& frame) {
      finder_->push(grey_.of({format(), frame.view().data, frame.stride()}), threads());
    };
    if (!finder_ || finder_method_ != flow_) {
      finder_ = make_dense_flow(flow_, format().width, format().height);
      finder_method_ = flow_;
      push(last_);
    }
    push(now_);
    return finder_->flow(threads());
  }

  Plane<Pixel> last_;
  Plane<Pixel> now_;
  PathWalker walker_;
  std::unique_ptr<DenseFlow> finder_;  ///< knows the last frame
  FlowMethod finder_method_{};
  Grey8 grey_;
};

}  // namespace

std::unique_ptr<DenseSimulator> make_dense_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<InterpolatingSimulator<std::uint16_t>>(format);
  return std::make_unique<InterpolatingSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
