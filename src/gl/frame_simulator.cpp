// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/simulator.hpp"

#include "src/gl/kernels.hpp"

namespace eventcamera::gl {
namespace {

class FrameSimulator final : public Simulator {
 public:
  FrameSimulator(const Context& gl, const LumaFormat& format)
      : Simulator(gl, format),
        luma_(gl),
        difference_(gl, format),
        frames_{{gl, format}, {gl, format}} {}

 private:
  void start(const TextureFrame& frame) override { luma_.run(frame, frames_[last_]); }

  void mark(const TextureFrame& frame, const StepTimes& steps, const Settings& settings,
            EventList& list) override {
    const auto& before = frames_[last_];
    last_ = 1 - last_;
    luma_.run(frame, frames_[last_]);
    list.begin(steps, steps.count());
    difference_.run(before, frames_[last_], Thresholds::of(settings, format().bits), 1, list);
  }

  LumaKernel luma_;
  DifferenceKernel difference_;
  GreyFrame frames_[2];
  int last_ = 0;
};

}  // namespace

std::unique_ptr<Simulator> make_frame_simulator(const Context& gl, const LumaFormat& format) {
  return std::make_unique<FrameSimulator>(gl, format);
}

}  // namespace eventcamera::gl
