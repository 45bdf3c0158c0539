// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "src/core/event_buckets.hpp"
#include "src/core/label.hpp"
#include "src/core/luma.hpp"
#include "src/core/thread_pool.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/simulate/denoiser.hpp"
#include "src/simulate/rolling_shutter.hpp"

namespace eventcamera {

/// Settings of all simulators; may change before each frame.
struct Settings {
  double positive_threshold = 20;  ///< C+, 8-bit grey levels; a rise must exceed it
  double negative_threshold = 20;  ///< C-, 8-bit grey levels, a magnitude; a fall must exceed it
  int interpolated_frames = 10;    ///< n, between two frames; 0 or more
  int threads = 0;                 ///< thread limit for one frame; 0 = one per processor
  bool labels = false;             ///< label the events, if the simulator can
  double denoise = 0;  ///< largest noise in the frames, grey levels, or automatic_denoise
  /// Time from reading a frame's first row to reading its last; negative if the camera reads the
  /// last row first. A frame's time is that of the row read first.
  Nanoseconds rolling_shutter = 0;
};

/// C+ and C- in the grey levels of a frame, integers like its pixel differences.
struct Thresholds {
  int positive;
  int negative;

  /// Scales the thresholds with the bit depth, so that 16-bit video gives the same events as its
  /// 8-bit version.
  static Thresholds of(const Settings& settings, int bits) {
    const auto scale = [bits](double grey_levels) {
      return static_cast<int>(std::max(0.0, grey_levels) * ((1 << bits) - 1) / 255);
    };
    return {scale(settings.positive_threshold), scale(settings.negative_threshold)};
  }
};

/// Times of the steps of an interval (t0, t1]: step j of `count` is at t0 + (t1 - t0) * j / count,
/// the last at t1. Unless the interval is shorter, a step lasts at least a microsecond, the
/// resolution of an event stream.
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

/// Time and threads of a simulator, independent of the kind of frames.
class IntervalSimulator {
 public:
  virtual ~IntervalSimulator() = default;
  IntervalSimulator(const IntervalSimulator&) = delete;
  IntervalSimulator& operator=(const IntervalSimulator&) = delete;

  std::optional<Nanoseconds> last_time() const { return last_time_; }

  /// Holds the last frame, if any, until `time`, which must not be before it: the next interval
  /// starts at `time`. Returns the sorted events of (time of the last frame, time], noise and
  /// events of late rows, valid until the next call; nullptr if there are none.
  const EventBuckets* hold_until(Nanoseconds time, const Settings& settings = {});

  /// Continues at `time`, which must not be before the last frame, as if no time had passed.
  void skip_until(Nanoseconds time) { last_time_ = time; }

  /// Time of the last event in late rows, which a rolling shutter read after the last interval, if
  /// any.
  std::optional<Nanoseconds> late_until() const;

  /// Like hold_until(), without noise: returns the events of late rows until `time`.
  const EventBuckets* late_events(Nanoseconds time);

  /// True if the events of the last interval have labels, which label() writes.
  bool has_labels() const { return labels_; }

  /// Writes the labels of all events of the last interval, which EventBuckets::write_to() wrote.
  virtual void label(const LabelledEvents&) {}

  /// True if the simulator estimates the optical flow of each interval, unless it is known.
  virtual bool needs_flow() const { return false; }

  /// Flow of the last interval, known or estimated; none if the simulator needed none. Valid until
  /// the next call. Estimated flow is 0 far from changed pixels.
  const std::optional<ImageView<Flow>>& flow() const { return flow_; }

  /// Forgets all frames; the next one is a first frame.
  void reset();

  /// The simulator's threads, usable between its calls.
  ThreadPool& threads() { return threads_; }

 protected:
  explicit IntervalSimulator(LumaFormat format) : format_(format), delayed_(format.height) {}

  const LumaFormat& format() const { return format_; }

  /// Prepares for a frame at `time`. Returns the steps of the interval that it ends; none for a
  /// first frame.
  std::optional<StepTimes> steps_to(Nanoseconds time, const Settings& settings);

  /// Fills `events` with noise events of an unchanged frame; false if the simulator has no noise.
  virtual bool hold(const StepTimes&, const Settings&, StepBuckets&) { return false; }

  /// Events of the last interval, of `duration`, and events of late rows that are due.
  virtual const EventBuckets& events(Nanoseconds duration, const Settings& settings);

  /// Time from the last frame to the last event of late rows, if any.
  virtual std::optional<Nanoseconds> latest() const { return delayed_.latest(); }

  /// Events of late rows until `duration` after the last frame.
  virtual const EventBuckets& late(Nanoseconds duration);

  std::optional<Nanoseconds> last_time_;  ///< of the last frame, where an interval begins
  std::optional<ImageView<Flow>> flow_;   ///< of the interval
  StepBuckets events_;

 private:
  LumaFormat format_;
  ThreadPool threads_;
  bool labels_ = false;
  DelayedRows delayed_;
};

/// Simulates the events between frames, on the CPU, in one call per frame. The same frames, times
/// and settings give the same events for any number of threads.
class Simulator : public IntervalSimulator {
 public:
  /// Processes the next frame, whose `format` must be the simulator's. `time` must be later than
  /// the last frame, by at most max_interval. Returns the sorted events of (time of the
  /// last frame, time], valid until the next call; nullptr for the first frame. `known_flow`, a
  /// view of an Image, is the motion from the last frame to this one. Throws std::bad_alloc or an
  /// exception of the implementation (cv::Exception); after that the simulator may only be
  /// destroyed.
  const EventBuckets* push(const LumaView& frame, Nanoseconds time, const Settings& settings,
                           const std::optional<ImageView<Flow>>& known_flow = {});

 protected:
  explicit Simulator(const LumaFormat& format) : IntervalSimulator(format), denoiser_(format) {}

  /// Settings::denoise, unless the simulator has its own.
  virtual double denoise_setting(const Settings& settings) const { return settings.denoise; }
  virtual void start(const LumaView& frame) = 0;
  /// Fills `events` with the events between the last frame and this one, and stores this one. Sets
  /// flow_ if it needs flow that is not known.
  virtual void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                        StepBuckets& events) = 0;

 private:
  Denoiser denoiser_;
};

}  // namespace eventcamera
