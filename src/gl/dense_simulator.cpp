// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/simulator.hpp"

#include <algorithm>

#include "src/flow/region_of_interest_flow.hpp"
#include "src/gl/farneback.hpp"
#include "src/gl/shaders.hpp"

namespace eventcamera::gl {
namespace {

class InterpolatingSimulator final : public DenseSimulator {
 public:
  InterpolatingSimulator(const Context& gl, const LumaFormat& format)
      : DenseSimulator(gl, format),
        farneback_(gl, format),
        changed_box_(gl, "changed_box", shaders::changed_box),
        stop_outside_(gl, "stop_outside", shaders::stop_outside),
        box_(gl),
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
    limit_flow(last, now, std::min(thresholds.positive, thresholds.negative), flow);
    list.begin(steps);
    kernel_.run(last, now, flow, interpolation_, thresholds, list);
  }

  /// Sets the flow between two frames to 0 outside the region around all pixels that changed by
  /// more than `threshold`, like RegionOfInterestFlow.
  void limit_flow(const GreyFrame& before, const GreyFrame& now, int threshold,
                  const Buffer& flow) {
    const auto [width, height, bits] = format();
    box_.assign_zeros(4 * sizeof(int));
    changed_box_.run({groups_of(64, GreyFrame::words_across(width)), height},
                     {&before.buffer(), &now.buffer(), &box_}, {width, height, threshold});
    stop_outside_.run(
        {groups_of(64, width), height}, {&box_, &flow},
        {width, height, RegionOfInterestFlow::surroundings, RegionOfInterestFlow::side_step});
  }

  void store(const TextureFrame& frame) {
    now_ = 1 - now_;
    luma_.run(frame, frames_[now_]);
    farneback_.push(frames_[now_]);
  }

  FarnebackFlow farneback_;
  Kernel changed_box_;
  Kernel stop_outside_;
  Buffer box_;
  InterpolationKernel kernel_;
  GreyFrame frames_[2];
  int now_ = 0;
};

}  // namespace

std::unique_ptr<DenseSimulator> make_dense_simulator(const Context& gl, const LumaFormat& format) {
  return std::make_unique<InterpolatingSimulator>(gl, format);
}

}  // namespace eventcamera::gl
