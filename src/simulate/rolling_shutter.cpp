// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/rolling_shutter.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <span>

#include "src/core/label.hpp"

namespace eventcamera {

const EventBuckets& RollingShutter::delay(const EventBuckets& events, Nanoseconds duration,
                                          Nanoseconds readout, ThreadPool& threads) {
  if (delays_.empty() || readout != readout_) set_readout(readout);
  bands_.resize(static_cast<std::size_t>(events.bands()));
  const auto last = static_cast<std::uint32_t>(duration / 1000);
  const auto next = static_cast<std::uint32_t>((duration + 999) / 1000);  // the next interval's 0
  delayed_.reset(last, events.bands());
  threads.for_each(events.bands(), [&](int i, int) {
    auto& [due, deferred] = bands_[static_cast<std::size_t>(i)];
    due.clear();
    std::size_t kept = 0;
    for (Event event : deferred) {
      if (event.t <= last) {
        due.push_back(event);
      } else {
        event.t -= next;
        deferred[kept++] = event;
      }
    }
    deferred.resize(kept);
    events.visit_band(i, [&](std::span<const Event> list) {
      for (Event event : list) {
        const std::uint64_t t = std::uint64_t{event.t} + delays_[event.y_p & coordinate_bits];
        event.t = static_cast<std::uint32_t>(t <= last ? t : t - next);
        (t <= last ? due : deferred).push_back(event);
      }
    });
    delayed_.add(i, due);
  });
  return delayed_;
}

const EventBuckets& RollingShutter::delay_none(Nanoseconds duration, ThreadPool& threads) {
  StepBuckets none;
  none.reset(0, std::max(1, static_cast<int>(bands_.size())));
  return delay(none, duration, readout_, threads);
}

std::optional<Nanoseconds> RollingShutter::latest() const {
  std::optional<Nanoseconds> latest;
  for (const auto& band : bands_)
    for (const auto& event : band.deferred)
      latest = std::max(latest, std::optional(Nanoseconds{event.t} * 1000));
  return latest;
}

void RollingShutter::drop_causes() {
  for (auto& band : bands_)
    for (auto& event : band.deferred) event = without_cause(event);
}

void RollingShutter::set_readout(Nanoseconds readout) {
  readout_ = readout;
  delays_.resize(static_cast<std::size_t>(height_));
  for (int y = 0; y < height_; ++y) {
    const int rows_before = readout < 0 ? height_ - 1 - y : y;
    delays_[static_cast<std::size_t>(y)] = static_cast<std::uint32_t>(
        std::abs(readout) * rows_before / std::max(1, height_ - 1) / 1000);
  }
}

}  // namespace eventcamera
