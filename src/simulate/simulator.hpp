// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "src/core/event_buckets.hpp"
#include "src/core/luma.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// What every simulator may be told anew before each frame.
struct Settings {
  double positive_threshold = 20;  ///< C+, 8-bit grey levels; a rise must exceed it
  double negative_threshold = 20;  ///< C-, 8-bit grey levels, a magnitude; a fall must exceed it
  int interpolated_frames = 10;    ///< n, between two frames; 0 or more
  int threads = 0;                 ///< the most threads for one frame; 0 = one for each processor
};

/// C+ and C- in the grey levels of a picture: integers, since its differences are.
struct Thresholds {
  int positive;
  int negative;

  /// Thresholds scale with the depth, so that a picture in 16 bits fires like its 8-bit twin.
  static Thresholds of(const Settings& settings, int bits) {
    const auto scale = [bits](double grey_levels) {
      return static_cast<int>(std::max(0.0, grey_levels) * ((1 << bits) - 1) / 255);
    };
    return {scale(settings.positive_threshold), scale(settings.negative_threshold)};
  }
};

/// The times of the steps of an interval (t0, t1]: step j of `count` is at t0 + (t1 - t0) * j /
/// count, the last one at t1. A step takes at least a microsecond, the resolution of an event
/// stream.
class StepTimes {
 public:
  /// `duration` in (0, max_interval]; `wanted` steps, at least 1.
  StepTimes(Nanoseconds duration, int wanted)
      : duration_(duration),
        count_(static_cast<int>(
            std::clamp<Nanoseconds>(duration / 1000, 1, static_cast<Nanoseconds>(wanted)))) {}

  Nanoseconds duration() const { return duration_; }
  int count() const { return count_; }
  /// Microseconds from t0 to step j (1 ... count), rounded down.
  std::uint32_t microseconds(int j) const {
    return static_cast<std::uint32_t>(duration_ * j / count_ / 1000);
  }

 private:
  Nanoseconds duration_;
  int count_;
};

/// Turns frames into the events between them. What follows from a frame is worked out in one call,
/// so a method may live on any processor behind this face. The same frames, times and settings
/// give the same events, whatever the number of threads.
class Simulator {
 public:
  virtual ~Simulator() = default;
  Simulator(const Simulator&) = delete;
  Simulator& operator=(const Simulator&) = delete;

  /// Takes the next frame, in the format the simulator was made for. `time` must lie after that
  /// of the last frame, by max_interval at most.
  /// Returns the sorted events of (time of the last frame, time], good until the next call; or
  /// nullptr for the first frame, to which the next is compared.
  /// Throws std::bad_alloc, or what OpenCV throws; the simulator is then good for nothing but being
  /// destroyed.
  const EventBuckets* push(const LumaView& frame, Nanoseconds time, const Settings& settings);

  /// The time of the last frame, if there is one.
  std::optional<Nanoseconds> last_time() const { return last_time_; }

  /// Says that the last frame still stood at `time`, which must not lie before it: the events up
  /// to the next frame are those of (time, time of the next frame]. Without effect where there is
  /// no last frame. Returns what fired in (time of the last frame, time] although nothing changed,
  /// sorted and good until the next call; or nullptr where that cannot be.
  const EventBuckets* hold_until(Nanoseconds time, const Settings& settings = {});

  /// Forgets all frames: the next one is a first frame.
  void reset();

  /// What it works with, for what is done with its events between its calls.
  ThreadPool& threads() { return threads_; }

 protected:
  explicit Simulator(LumaFormat format) : format_(format) {}

  const LumaFormat& format() const { return format_; }

  /// Keeps the first frame.
  virtual void start(const LumaView& frame) = 0;
  /// Fills `events` from the last frame and this one, and keeps this one.
  virtual void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                        EventBuckets& events) = 0;
  /// Fills `events` with what the pixels do of themselves while the last frame stands, if they do.
  virtual bool hold(const StepTimes&, const Settings&, EventBuckets&) { return false; }

 private:
  LumaFormat format_;
  std::optional<Nanoseconds> last_time_;
  EventBuckets events_;
  ThreadPool threads_;
};

}  // namespace eventcamera
