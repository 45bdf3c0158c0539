// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "bench/naive/frame.hpp"
#include "bench/naive/opencv.hpp"
#include "src/simulate/warp.hpp"

namespace naive {

/// Dense forward interpolation with a given flow.
class DenseInterpolation {
 public:
  DenseInterpolation(int width, int height)
      : dx_(width, height),
        dy_(width, height),
        between_{Image<std::uint8_t>(width, height), Image<std::uint8_t>(width, height)} {}

  void fire(const FrameView& last, const FrameView& now, const ImageView<Flow>& flow,
            const StepTimes& steps, const Thresholds& thresholds, ThreadPool& threads,
            StepBuckets& events) {
    const int m = steps.count();
    const Warp<std::uint8_t> warp{last, now, m};
    threads.for_each(now.height, [&](int y, int) {
      for (int x = 0; x < now.width; ++x) {
        dx_.at(x, y) = motion_per_step(flow.row(y)[x].x, m);
        dy_.at(x, y) = motion_per_step(flow.row(y)[x].y, m);
      }
    });
    events.reset(m, band_count(now.height));
    auto before = last;
    for (int j = 1; j < m; ++j) {
      auto& between = between_[j % 2];
      threads.for_each(now.height, [&](int y, int) {
        for (int x = 0; x < now.width; ++x)
          between.at(x, y) = warp.at<Interpolation::forward>(x, y, dx_.at(x, y), dy_.at(x, y), j);
      });
      naive::fire(before, between.view(), j, steps.microseconds(j), thresholds, threads, events);
      before = between.view();
    }
    naive::fire(before, now, m, steps.microseconds(m), thresholds, threads, events);
  }

 private:
  Image<Motion> dx_;
  Image<Motion> dy_;
  Image<std::uint8_t> between_[2];
};

/// Dense interpolation, including the flow.
class DenseSimulator final : public Simulator {
 public:
  DenseSimulator(const LumaFormat& format, FlowMethod method)
      : Simulator(format),
        last_(format.width, format.height),
        flow_(method, format.width, format.height),
        interpolation_(format.width, format.height) {}

 private:
  void start(const LumaView& frame) override { last_.assign(frame.as<std::uint8_t>()); }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                StepBuckets& events) override {
    const auto now = frame.as<std::uint8_t>();
    interpolation_.fire(last_.view(), now, flow_.find(last_.view(), now, threads().threads()),
                        steps, Thresholds::of(settings, 8), threads(), events);
    copy(now, last_, threads());
  }

  Image<std::uint8_t> last_;
  OpenCvFlow flow_;
  DenseInterpolation interpolation_;
};

}  // namespace naive
