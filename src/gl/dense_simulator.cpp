// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/dense_simulator.hpp"

#include <algorithm>

#include "src/gl/farneback.hpp"
#include "src/gl/interpolation.hpp"
#include "src/gl/region_of_interest.hpp"

namespace eventcamera::gl {
namespace {

class InterpolatingSimulator final : public DenseSimulator {
 public:
  InterpolatingSimulator(const Context& gl, const LumaFormat& format)
      : DenseSimulator(gl, format),
        luma_(gl),
        farneback_(gl, format),
        region_(gl, format),
        kernel_(gl, format),
        frames_{{gl, format}, {gl, format}} {}

 private:
  void start(const TextureFrame& frame) override { store(frame); }

  void mark(const TextureFrame& frame, const StepTimes& steps, const Settings& settings,
            EventList& list) override {
    const auto thresholds = Thresholds::of(settings, format().bits);
    const auto& last = frames_[now_];
    store(frame);
    const auto& now = frames_[now_];
    const Buffer& flow = farneback_.find();
    region_.limit(last, now, std::min(thresholds.positive, thresholds.negative), flow);
    list.begin(steps);
    kernel_.run(last, now, flow, interpolation_, thresholds, list);
  }

  void store(const TextureFrame& frame) {
    now_ = 1 - now_;
    luma_.run(frame, frames_[now_]);
    farneback_.push(frames_[now_]);
  }

  LumaKernel luma_;
  FarnebackFlow farneback_;
  RegionOfInterest region_;
  InterpolationKernel kernel_;
  GreyFrame frames_[2];
  int now_ = 0;
};

}  // namespace

std::unique_ptr<DenseSimulator> make_dense_simulator(const Context& gl, const LumaFormat& format) {
  return std::make_unique<InterpolatingSimulator>(gl, format);
}

}  // namespace eventcamera::gl
