// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <deque>
#include <optional>
#include <utility>

#include "src/core/event.hpp"

namespace eventcamera {

/// Decides which frames to skip where there is no time for all of them, so that the others are
/// shown in time. All times are running times. A frame is skipped
/// - if it has waited upstream, because those before it took long, and its picture would come when
///   that of the next frame is due;
/// - if two pictures are on their way downstream, and the first will be late;
/// - if downstream wants fewer pictures.
///
/// Nothing is skipped unless downstream reports when it got the pictures.
class FramePacer {
 public:
  /// Takes the next frame. Returns whether to skip it.
  bool skip(Nanoseconds frame, Nanoseconds now) {
    if (frame < frame_) start_over();
    step_ = frame - std::exchange(frame_, frame);
    const Nanoseconds delay = now - frame;
    const bool was_awaited = now - left_ >= step_ / 2;
    if (!usual_delay_ || was_awaited || delay < *usual_delay_) usual_delay_ = delay;
    lag_ = delay - *usual_delay_;
    left_ = now;
    const bool is_late = due_after_ && (lag_ > step_ + slack_ || is_downstream_behind(now));
    if (!is_late && frame >= wanted_from_) return false;
    if (now - ended_ < max_pause) return true;
    due_after_.reset();  // reports have ceased
    return false;
  }

  /// Starts processing the frame. The output that it completes starts at `output`.
  void begin(std::optional<Nanoseconds> output) {
    if (!due_after_) on_their_way_.clear();
    if (output) on_their_way_.push_back({*output, lag_, on_their_way_.size() < 2});
    wanted_from_ = frame_ + throttle_;
    period_ = frame_ - std::exchange(begun_, frame_);
    began_ = left_;
  }

  /// Expected time from the picture of the frame that is being processed to the next picture; 0 if
  /// no frames are skipped.
  Nanoseconds period(Nanoseconds now) const {
    return due_after_ ? std::min(std::max(now - began_, period_), max_period) : 0;
  }

  /// The output has been pushed.
  void end(Nanoseconds now) { left_ = ended_ = now; }

  /// Downstream reports how late (if negative, early) the output that starts at `start` was.
  void take_lateness(Nanoseconds start, Nanoseconds lateness, Nanoseconds now) {
    throttle_ = 0;
    due_after_ = now - std::max(lateness, Nanoseconds{0}) - start;
    const auto picture = arrived(start);
    if (!picture) return;
    slack_ = std::clamp(picture->lag - lateness, Nanoseconds{0}, max_latency);
    if (picture->is_alone) learn_latency(lateness, now);
  }

  /// Downstream, which got the output that starts at `start`, wants at most one per `interval`.
  void take_throttle(Nanoseconds start, Nanoseconds interval) {
    throttle_ = std::clamp(interval, Nanoseconds{0}, max_throttle);
    arrived(start);
  }

  /// Latency of elements downstream that they do not report.
  Nanoseconds downstream_latency() const { return latency_; }

  /// Forgets the frames, at a new segment.
  void start_over() {
    const Nanoseconds latency = latency_;
    *this = {};
    latency_ = latency;
  }

 private:
  static constexpr Nanoseconds ms = 1'000'000;
  static constexpr Nanoseconds max_pause = 1000 * ms;
  static constexpr Nanoseconds max_period = 1000 * ms;
  static constexpr Nanoseconds max_throttle = 10'000 * ms;
  static constexpr Nanoseconds max_latency = 1000 * ms;

  struct Picture {
    Nanoseconds start;
    Nanoseconds lag;  ///< for which its frame waited upstream
    bool is_alone;    ///< nothing else is queued ahead of it downstream
  };

  /// Latencies are learnt from at least so many reports in so long a time.
  static constexpr int min_reports = 3;
  static constexpr Nanoseconds learning_time = 500 * ms;
  static constexpr Nanoseconds max_earliness = 20 * ms;

  struct Reports {
    Nanoseconds since = 0;
    int count = 0;
    Nanoseconds least = 0;
    Nanoseconds most = 0;
  };

  /// The picture that starts at `start`, which is no longer on its way, as those before it.
  std::optional<Picture> arrived(Nanoseconds start) {
    std::optional<Picture> picture;
    for (; !on_their_way_.empty() && on_their_way_.front().start <= start;
         on_their_way_.pop_front())
      picture = on_their_way_.front();
    return picture;
  }

  /// True if a second picture is on its way, although the time to work on the first has begun.
  bool is_downstream_behind(Nanoseconds now) const {
    return on_their_way_.size() >= 2 && now + latency_ > on_their_way_.front().start + *due_after_;
  }

  /// Raises the latency where all pictures are late, and lowers it where all are early.
  void learn_latency(Nanoseconds lateness, Nanoseconds now) {
    if (reports_.count++ == 0) reports_ = {now, 1, lateness, lateness};
    reports_.least = std::min(reports_.least, lateness);
    reports_.most = std::max(reports_.most, lateness);
    if (reports_.count < min_reports || now - reports_.since < learning_time) return;
    if (reports_.least > 0)
      latency_ = std::min(latency_ + reports_.least, max_latency);
    else if (reports_.most < -max_earliness)
      latency_ = std::max(latency_ + reports_.most, Nanoseconds{0});
    reports_.count = 0;
  }

  Nanoseconds frame_ = 0;   ///< the last one
  Nanoseconds step_ = 0;    ///< from the frame before to that frame
  Nanoseconds lag_ = 0;     ///< for which it waited upstream
  Nanoseconds slack_ = 0;   ///< for which a frame may wait, and its picture be in time
  Nanoseconds left_ = 0;    ///< when upstream could send the next one
  Nanoseconds begun_ = 0;   ///< the last processed frame
  Nanoseconds period_ = 0;  ///< from the processed frame before to that frame
  Nanoseconds began_ = 0;   ///< when its processing began
  Nanoseconds ended_ = 0;   ///< when it ended
  std::optional<Nanoseconds> usual_delay_;  ///< of frames that do not wait
  Nanoseconds throttle_ = 0;
  Nanoseconds wanted_from_ = 0;

  std::deque<Picture> on_their_way_;      ///< not yet reported
  std::optional<Nanoseconds> due_after_;  ///< time from the start of a picture to its showing
  Reports reports_;
  Nanoseconds latency_ = 0;
};

}  // namespace eventcamera
