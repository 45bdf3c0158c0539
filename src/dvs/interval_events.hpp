// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/event_buckets.hpp"
#include "src/core/label.hpp"
#include "src/core/thread_pool.hpp"
#include "src/dvs/state_bytes.hpp"

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
  /// Begins an interval of `duration` microseconds with the deferred events of the last one. Events
  /// are written to `events`, with_cause().
  void begin(double duration, int bands, EventBuckets& events) {
    duration_ = duration;
    events_ = &events;
    events.reset_slices(static_cast<std::uint32_t>(duration), bands);
    deferred_.resize(static_cast<std::size_t>(bands));
    for (int band = 0; band < bands; ++band) {
      due_.swap(deferred_[static_cast<std::size_t>(band)]);
      const Band here(*this, band);
      for (const auto& [t, event] : due_) here.add(t, event);
      due_.clear();
    }
  }

  /// Drops the causes of the deferred events.
  void drop_causes() {
    for (auto& band : deferred_)
      for (auto& deferred : band) deferred.event = without_cause(deferred.event);
  }

  /// Drops the deferred events.
  void reset() { deferred_.clear(); }

  /// Passes the deferred events of a sensor of this size to a StateWriter or StateReader.
  template <class State>
  void pass(State& state, int width, int height) {
    deferred_.resize(static_cast<std::size_t>(band_count(height)));
    for (int band = 0; band < band_count(height); ++band) {
      const BandRows rows(band, height);
      auto& deferred = deferred_[static_cast<std::size_t>(band)];
      deferred.resize(state.count(deferred.size(), sizeof(double) + sizeof(Event)));
      for (auto& [t, event] : deferred) {
        state.value(t, is_within(0.0, max_state_time));
        state.value(event, is_event_within({0, rows.first, width, rows.last}));
      }
    }
  }

  /// One band of rows. Different bands may be added to from different threads.
  class Band {
   public:
    Band(IntervalEvents& events, int band)
        : duration_(events.duration_),
          slices_(*events.events_, band),
          deferred_(&events.deferred_[static_cast<std::size_t>(band)]) {}

    /// Duration of the interval, microseconds.
    double duration() const { return duration_; }

    /// Adds an event within the interval.
    void add(const Event& event) const { slices_.add(event); }

    void add(double t, int x, int y, Polarity polarity, Cause cause) const {
      add(t, with_cause(Event::at(x, y, 0, polarity), cause));
    }

    /// Adds an event `t` microseconds after the start of the interval, instead of its own time.
    void add(double t, Event event) const {
      if (t > duration_) {
        deferred_->push_back({t - duration_, event});
        return;
      }
      event.t = static_cast<std::uint32_t>(t);
      slices_.add(event);
    }

   private:
    double duration_;
    EventBuckets::BandSlices slices_;
    Deferred* deferred_;
  };

 private:
  double duration_ = 0;
  EventBuckets* events_ = nullptr;
  std::vector<Deferred> deferred_;  ///< by band
  Deferred due_;                    ///< deferred to the interval that begins
};

}  // namespace eventcamera
