// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "bench/plain/pixels.hpp"

namespace plain {

/// The difference frame.
class FrameSimulator final : public Simulator {
 public:
  explicit FrameSimulator(const LumaFormat& format)
      : Simulator(format), last_(format.width, format.height) {}

 private:
  void start(const LumaView& frame) override { last_.assign(frame.as<std::uint8_t>()); }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                EventBuckets& events) override {
    const auto now = frame.as<std::uint8_t>();
    events.reset(1, band_count(now.height));
    fire(last_.view(), now, 1, steps.microseconds(steps.count()), Thresholds::of(settings, 8),
         threads(), events);
    copy(now, last_, threads());
  }

  Image<std::uint8_t> last_;
};

}  // namespace plain
