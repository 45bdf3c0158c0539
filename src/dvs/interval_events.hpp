// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event_buckets.hpp"
#include "src/core/label.hpp"
#include "src/core/thread_pool.hpp"
#include "src/core/time_slices.hpp"
#include "src/dvs/readout.hpp"
#include "src/simulate/rolling_shutter.hpp"

namespace eventcamera {

/// Collects the events of an interval from bands of rows, in any order. Events past its end are
/// deferred to the next interval. A rolling shutter of the frames delays all events of a row; at a
/// limited rate, a Readout delays them further.
class IntervalEvents {
  struct DeferredEvent {
    double t;  ///< microseconds after the start of the next interval
    Event event;
  };
  struct alignas(64) Deferred : std::vector<DeferredEvent> {};

 public:
  IntervalEvents(int width, int height)
      : width_(width), height_(height), deferred_(band_count(height)) {}

  /// Begins an interval of `duration` microseconds. `max_rate` is in events per second; 0 = no
  /// limit. `rolling_shutter` is as for row_delays().
  void begin(double duration, double max_rate, Nanoseconds rolling_shutter) {
    duration_ = duration;
    max_rate_ = max_rate;
    if (rolling_shutter != rolling_shutter_) delays_ = row_delays(rolling_shutter, height_);
    rolling_shutter_ = rolling_shutter;
    if (max_rate > 0 && !readout_) readout_.emplace(width_, height_);
    fired_.reset(static_cast<std::uint32_t>(duration), band_count(height_));
  }

  /// True if no event is delayed, and none was deferred to this interval.
  bool is_plain() const {
    return rolling_shutter_ == 0 && !readout_ &&
           std::ranges::all_of(deferred_, [](const Deferred& band) { return band.empty(); });
  }

  /// Ends the interval, after the last event. Returns its events, with_cause(), in `read` if there
  /// is a readout.
  const EventBuckets& end(StepBuckets& read, ThreadPool& threads) {
    if (!readout_) return fired_;
    sorted_.resize(fired_.size());
    fired_.write_to(sorted_.data(), threads);
    readout_->read(sorted_, duration_, max_rate_ > 0 ? max_rate_ : unlimited, read);
    if (max_rate_ == 0) readout_.reset();  // no events are waiting any more
    return read;
  }

  /// Time from the end of the interval to the last event deferred by a rolling shutter, rounded up,
  /// if any.
  std::optional<Nanoseconds> latest() const {
    std::optional<double> latest;
    if (rolling_shutter_ == 0) return std::nullopt;
    for (const auto& band : deferred_)
      for (const auto& deferred : band) latest = std::max(latest, std::optional(deferred.t));
    if (!latest) return std::nullopt;
    return static_cast<Nanoseconds>(*latest * 1000) + 1;
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

  /// Adds the events of one band of rows at a time. Threads may use several for the same interval.
  class Band {
   public:
    /// Begins with the deferred events of the last interval.
    void begin(IntervalEvents& events, int band) {
      duration_ = events.duration_;
      delays_ = events.rolling_shutter_ != 0 ? events.delays_.data() : nullptr;
      fired_ = &events.fired_;
      band_ = band;
      deferred_ = &events.deferred_[band];
      added_.clear();
      kept_ = 0;
      for (const auto& [t, event] : *deferred_) {
        if (t > duration_)
          (*deferred_)[kept_++] = {t - duration_, event};
        else
          add_within(t, event);
      }
      deferred_->resize(kept_);
      due_ = added_.size();
    }

    double duration() const { return duration_; }

    void add(std::span<const Event> events) {
      added_.insert(added_.end(), events.begin(), events.end());
    }

    /// Adds an event with the time `t`, microseconds after the start of the interval, in place of
    /// its own.
    void add(double t, const Event& event) {
      if (t > duration_)
        deferred_->push_back({t - duration_, event});
      else
        add_within(t, event);
    }

    /// Must be called after the last event.
    void end() {
      if (delays_ != nullptr) delay_rows();
      fired_->add(band_, added_);
    }

   private:
    void delay_rows() {
      const auto delay_of = [this](const Event& event) {
        return delays_[event.y_p & coordinate_bits];
      };
      for (std::size_t i = kept_; i < deferred_->size(); ++i)
        (*deferred_)[i].t += delay_of((*deferred_)[i].event);
      const double next_start = std::ceil(duration_);
      std::size_t count = due_;
      for (std::size_t i = due_; i < added_.size(); ++i) {
        Event event = added_[i];
        const std::uint64_t t = std::uint64_t{event.t} + delay_of(event);
        if (static_cast<double>(t) > duration_) {
          deferred_->push_back({static_cast<double>(t) - next_start, event});
        } else {
          event.t = static_cast<std::uint32_t>(t);
          added_[count++] = event;
        }
      }
      added_.resize(count);
    }

    void add_within(double t, Event event) {
      event.t = static_cast<std::uint32_t>(t);
      added_.push_back(event);
    }

    double duration_ = 0;
    const std::uint32_t* delays_ = nullptr;  ///< by row, if there is a rolling shutter
    TimeSlices* fired_ = nullptr;
    int band_ = 0;
    Deferred* deferred_ = nullptr;
    std::vector<Event> added_;
    std::size_t kept_ = 0;  ///< number of events deferred by earlier intervals
    std::size_t due_ = 0;   ///< number of events added by earlier intervals
  };

 private:
  /// Rate limit that no array reaches, events per second.
  static constexpr double unlimited = 1e18;

  int width_;
  int height_;
  double duration_ = 0;
  double max_rate_ = 0;
  Nanoseconds rolling_shutter_ = 0;
  std::vector<std::uint32_t> delays_;  ///< by row
  TimeSlices fired_;
  std::vector<Deferred> deferred_;  ///< by band
  std::vector<Event> sorted_;       ///< for the readout
  std::optional<Readout> readout_;
};

}  // namespace eventcamera
