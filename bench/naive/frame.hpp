// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstring>

#include "src/core/event_buckets.hpp"
#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"
#include "src/simulate/simulator.hpp"

/// Naive implementations, as a baseline for speed: each method in its most direct form, with
/// OpenCV's optical flow and simple loops over the pixels of one frame after another, on all
/// threads. 8-bit frames.
namespace naive {

using namespace eventcamera;
using FrameView = ImageView<std::uint8_t>;

/// Fires where the difference of two frames exceeds the thresholds.
inline void fire(const FrameView& before, const FrameView& now, int step, std::uint32_t t,
                 const Thresholds& thresholds, ThreadPool& threads, StepBuckets& events) {
  threads.for_each(band_count(now.height), [&](int band, int) {
    auto& out = events.bucket(step, band);
    const BandRows rows(band, now.height);
    for (int y = rows.first; y < rows.last; ++y) {
      const auto* before_row = before.row(y);
      const auto* now_row = now.row(y);
      for (int x = 0; x < now.width; ++x) {
        const int difference = now_row[x] - before_row[x];
        if (difference > thresholds.positive)
          out.push_back(Event::at(x, y, t, Polarity::on));
        else if (-difference > thresholds.negative)
          out.push_back(Event::at(x, y, t, Polarity::off));
      }
    }
  });
}

/// Copies an image of the same size.
inline void copy(const FrameView& from, Image<std::uint8_t>& to, ThreadPool& threads) {
  threads.for_each(band_count(from.height), [&](int band, int) {
    const BandRows rows(band, from.height);
    for (int y = rows.first; y < rows.last; ++y)
      std::memcpy(to.row(y), from.row(y), static_cast<std::size_t>(from.width));
  });
}

/// Frame: the difference of two frames.
class FrameSimulator final : public Simulator {
 public:
  explicit FrameSimulator(const LumaFormat& format)
      : Simulator(format), last_(format.width, format.height) {}

 private:
  void start(const LumaView& frame) override { last_.assign(frame.as<std::uint8_t>()); }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                StepBuckets& events) override {
    const auto now = frame.as<std::uint8_t>();
    events.reset(1, band_count(now.height));
    fire(last_.view(), now, 1, steps.microseconds(steps.count()), Thresholds::of(settings, 8),
         threads(), events);
    copy(now, last_, threads());
  }

  Image<std::uint8_t> last_;
};

}  // namespace naive
