// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "src/parallel/thread_pool.hpp"
#include "src/simulate/bands.hpp"
#include "src/simulate/path.hpp"

/// The methods as anyone would write them: one picture after another, simple loops over its pixels,
/// shared out over the threads. What the simulators' speed is a ratio to.
namespace plain {

using namespace eventcamera;

/// The events of a difference, band by band.
inline void fire(const Plane<std::uint8_t>& before, const Plane<std::uint8_t>& now, int step,
                 std::uint32_t t, const Thresholds& thresholds, ThreadPool& threads,
                 EventBuckets& events) {
  threads.for_each(band_count(now.height()), [&](int band, int) {
    auto& out = events.bucket(step, band);
    const BandRows rows(band, now.height());
    for (int y = rows.first; y < rows.last; ++y) {
      for (int x = 0; x < now.width(); ++x) {
        const int difference = now.at(x, y) - before.at(x, y);
        if (difference > thresholds.positive)
          out.push_back(Event::at(x, y, t, Polarity::on));
        else if (-difference > thresholds.negative)
          out.push_back(Event::at(x, y, t, Polarity::off));
      }
    }
  });
}

/// The difference frame.
inline void frame(const Plane<std::uint8_t>& last, const Plane<std::uint8_t>& now,
                  const StepTimes& steps, const Thresholds& thresholds, ThreadPool& threads,
                  EventBuckets& events) {
  events.reset(1, band_count(now.height()));
  fire(last, now, 1, steps.microseconds(steps.count()), thresholds, threads, events);
}

/// Dense interpolation, after the flow is found: forward.
inline void dense(const Plane<std::uint8_t>& last, const Plane<std::uint8_t>& now,
                  const PlaneView<Flow>& flow, const StepTimes& steps, const Thresholds& thresholds,
                  ThreadPool& threads, EventBuckets& events) {
  const int m = steps.count();
  const Warp<std::uint8_t> warp{last.view(), now.view(), m};
  Plane<Motion> dx(now.width(), now.height());
  Plane<Motion> dy(now.width(), now.height());
  threads.for_each(now.height(), [&](int y, int) {
    for (int x = 0; x < now.width(); ++x) {
      dx.at(x, y) = motion_per_step(flow.row(y)[x].x, m);
      dy.at(x, y) = motion_per_step(flow.row(y)[x].y, m);
    }
  });
  auto before = last;
  Plane<std::uint8_t> between(now.width(), now.height());
  events.reset(m, band_count(now.height()));
  for (int j = 1; j <= m; ++j) {
    if (j == m) {
      between = now;
    } else {
      threads.for_each(now.height(), [&](int y, int) {
        for (int x = 0; x < now.width(); ++x)
          between.at(x, y) = warp.at<Interpolation::forward>(x, y, dx.at(x, y), dy.at(x, y), j);
      });
    }
    fire(before, between, j, steps.microseconds(j), thresholds, threads, events);
    std::swap(before, between);
  }
}

}  // namespace plain
