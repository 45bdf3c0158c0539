// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/frame.hpp"

#include <utility>

#include "src/gl/difference.hpp"
#include "src/gl/event_list.hpp"

namespace eventcamera::gl {
namespace {

class FrameSimulator final : public Simulator {
 public:
  FrameSimulator(const Context& gl, const LumaFormat& format)
      : Simulator(format),
        luma_(gl),
        difference_(gl, format),
        list_(gl, format),
        frames_{{gl, format}, {gl, format}} {}

 private:
  void start(const TextureFrame& frame) override { luma_.run(frame, frames_[last_]); }

  void simulate(const TextureFrame& frame, const StepTimes& steps, const Settings& settings,
                EventBuckets& events) override {
    const auto& before = frames_[last_];
    last_ = 1 - last_;
    luma_.run(frame, frames_[last_]);
    list_.begin(1);
    difference_.run(before, frames_[last_], Thresholds::of(settings, format().bits), 1, list_);
    const std::uint32_t t = steps.microseconds(steps.count());
    list_.read({&t, 1}, events);
  }

  LumaKernel luma_;
  DifferenceKernel difference_;
  EventList list_;
  GreyFrame frames_[2];
  int last_ = 0;
};

}  // namespace

std::unique_ptr<Simulator> make_frame_simulator(const Context& gl, const LumaFormat& format) {
  return std::make_unique<FrameSimulator>(gl, format);
}

}  // namespace eventcamera::gl
