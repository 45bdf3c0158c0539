// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event_buckets.hpp"
#include "src/core/label.hpp"
#include "src/core/thread_pool.hpp"
#include "src/core/time_slices.hpp"
#include "src/dvs/readout.hpp"

namespace eventcamera {

/// Events of an interval, which bands of rows add in any order. Events past its end are deferred to
/// the next interval. With a limited rate, a Readout delays the others.
class IntervalEvents {
  struct DeferredEvent {
    double t;  ///< microseconds after the start of the next interval
    Event event;
  };
  struct alignas(64) Deferred : std::vector<DeferredEvent> {};

 public:
  IntervalEvents(int width, int height)
      : width_(width), height_(height), deferred_(static_cast<std::size_t>(band_count(height))) {}

  /// Begins an interval of `duration` microseconds. `max_rate` is in events per second; 0 = no
  /// limit.
  void begin(double duration, double max_rate) {
    duration_ = duration;
    max_rate_ = max_rate;
    if (max_rate > 0 && !readout_) readout_.emplace(width_, height_);
    fired_.reset(static_cast<std::uint32_t>(duration), band_count(height_));
  }

  /// Events of the interval, after the last one was added; with_cause().
  const EventBuckets& fired() const { return fired_; }

  /// Reads out events within `duration` microseconds, in `read`; returns `events` themselves if the
  /// rate has no limit.
  const EventBuckets& read_out(const EventBuckets& events, double duration, StepBuckets& read,
                               ThreadPool& threads) {
    if (!readout_) return events;
    sorted_.resize(events.size());
    events.write_to(sorted_.data(), threads);
    readout_->read(sorted_, duration, max_rate_ > 0 ? max_rate_ : unlimited, read);
    if (max_rate_ == 0) readout_.reset();  // no events are waiting any more
    return read;
  }

  /// Drops the causes of the deferred and waiting events.
  void drop_causes() {
    for (auto& band : deferred_)
      for (auto& deferred : band) deferred.event = without_cause(deferred.event);
    if (readout_) readout_->drop_causes();
  }

  /// Drops the deferred and waiting events.
  void restart() {
    for (auto& band : deferred_) band.clear();
    if (readout_) readout_->reset();
  }

  /// Adds the events of one band of rows at a time. Several may add to the same interval, from
  /// different threads.
  class Band {
   public:
    /// Begins with the deferred events of the last interval.
    void begin(IntervalEvents& events, int band) {
      duration_ = events.duration_;
      fired_ = &events.fired_;
      band_ = band;
      deferred_ = &events.deferred_[static_cast<std::size_t>(band)];
      added_.clear();
      std::size_t kept = 0;
      for (const auto& [t, event] : *deferred_) {
        if (t > duration_)
          (*deferred_)[kept++] = {t - duration_, event};
        else
          add_within(t, event);
      }
      deferred_->resize(kept);
    }

    /// Duration of the interval, microseconds.
    double duration() const { return duration_; }

    /// Adds events within the interval.
    void add(std::span<const Event> events) {
      added_.insert(added_.end(), events.begin(), events.end());
    }

    /// Adds an event `t` microseconds after the start of the interval, instead of its own time.
    void add(double t, const Event& event) {
      if (t > duration_)
        deferred_->push_back({t - duration_, event});
      else
        add_within(t, event);
    }

    /// Must be called after the last event.
    void end() { fired_->add(band_, added_); }

   private:
    void add_within(double t, Event event) {
      event.t = static_cast<std::uint32_t>(t);
      added_.push_back(event);
    }

    double duration_ = 0;
    TimeSlices* fired_ = nullptr;
    int band_ = 0;
    Deferred* deferred_ = nullptr;
    std::vector<Event> added_;
  };

 private:
  /// Event rate limit that no array reaches, events per second.
  static constexpr double unlimited = 1e18;

  int width_;
  int height_;
  double duration_ = 0;
  double max_rate_ = 0;
  TimeSlices fired_;
  std::vector<Deferred> deferred_;  ///< by band
  std::vector<Event> sorted_;       ///< for the readout
  std::optional<Readout> readout_;
};

}  // namespace eventcamera
