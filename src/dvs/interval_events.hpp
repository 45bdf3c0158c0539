// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "src/core/event_buckets.hpp"
#include "src/core/label.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Collects the events of an interval, which bands of rows add in any order. Events past its end
/// are deferred to the next interval.
class IntervalEvents {
  struct DeferredEvent {
    double t;  ///< microseconds after the start of the next interval
    Event event;
  };
  struct alignas(64) Deferred : std::vector<DeferredEvent> {};

 public:
  /// Begins an interval of `duration` microseconds. Events are written to `events`, with_cause().
  void begin(double duration, int bands, EventBuckets& events) {
    duration_ = duration;
    events_ = &events;
    events.reset_slices(static_cast<std::uint32_t>(duration), bands);
    deferred_.resize(static_cast<std::size_t>(bands));
  }

  /// Drops the causes of the deferred events.
  void drop_causes() {
    for (auto& band : deferred_)
      for (auto& deferred : band) deferred.event = without_cause(deferred.event);
  }

  /// Drops the deferred events.
  void reset() { deferred_.clear(); }

  /// One band of rows. Different bands may be added to from different threads.
  class Band {
   public:
    /// Begins with the deferred events of the last interval. Until end(), events are in `added`,
    /// which is emptied first.
    Band(IntervalEvents& events, int band, std::vector<Event>& added)
        : duration_(events.duration_),
          events_(*events.events_),
          band_(band),
          deferred_(events.deferred_[static_cast<std::size_t>(band)]),
          added_(added) {
      added_.clear();
      std::size_t kept = 0;
      for (const auto& [t, event] : deferred_) {
        if (t > duration_)
          deferred_[kept++] = {t - duration_, event};
        else
          add_within(t, event);
      }
      deferred_.resize(kept);
    }

    /// Duration of the interval, microseconds.
    double duration() const { return duration_; }

    /// Adds events within the interval.
    void add(std::span<const Event> events) const {
      added_.insert(added_.end(), events.begin(), events.end());
    }

    void add(double t, int x, int y, Polarity polarity, Cause cause) const {
      add(t, with_cause(Event::at(x, y, 0, polarity), cause));
    }

    /// Adds an event `t` microseconds after the start of the interval, instead of its own time.
    void add(double t, const Event& event) const {
      if (t > duration_)
        deferred_.push_back({t - duration_, event});
      else
        add_within(t, event);
    }

    /// Must be called after the last event.
    void end() const { events_.add_slices(band_, added_); }

   private:
    void add_within(double t, Event event) const {
      event.t = static_cast<std::uint32_t>(t);
      added_.push_back(event);
    }

    double duration_;
    EventBuckets& events_;
    int band_;
    Deferred& deferred_;
    std::vector<Event>& added_;
  };

 private:
  double duration_ = 0;
  EventBuckets* events_ = nullptr;
  std::vector<Deferred> deferred_;  ///< by band
};

}  // namespace eventcamera
