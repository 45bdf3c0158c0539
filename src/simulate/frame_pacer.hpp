// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <deque>
#include <optional>
#include <utility>

#include "src/core/event.hpp"

namespace eventcamera {

/// Decides which frames to skip if there is no time for all of them, so that the others are shown
/// in time. All times are running times. A frame is skipped
/// - if it waited upstream, because earlier frames took long, and its picture would not be shown
///   before that of the next frame is due;
/// - if two pictures are in flight downstream, and the first will be late;
/// - if downstream wants fewer pictures.
///
/// No frame is skipped unless downstream reports when pictures arrive.
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
    due_after_.reset();  // downstream no longer reports
    return false;
  }

  /// Starts processing the frame, which completes the output that starts at `output`.
  void begin(std::optional<Nanoseconds> output) {
    if (!due_after_) in_flight_.clear();
    if (output) in_flight_.push_back({*output, lag_, in_flight_.size() < 2});
    wanted_from_ = frame_ + throttle_;
    period_ = frame_ - std::exchange(begun_, frame_);
    began_ = left_;
  }

  /// Expected time from the current frame's picture to the next picture; 0 if no frames are
  /// skipped.
  Nanoseconds period(Nanoseconds now) const {
    return due_after_ ? std::min(std::max(now - began_, period_), max_period) : 0;
  }

  /// Ends processing: the output has been pushed.
  void end(Nanoseconds now) { left_ = ended_ = now; }

  /// Takes a report by how much the output that starts at `start` was late (early if negative).
  void take_lateness(Nanoseconds start, Nanoseconds lateness, Nanoseconds now) {
    throttle_ = 0;
    due_after_ = now - std::max(lateness, Nanoseconds{0}) - start;
    const auto picture = arrived(start);
    if (!picture) return;
    slack_ = std::clamp(picture->lag - lateness, Nanoseconds{0}, max_latency);
    if (picture->is_alone) learn_latency(lateness, now);
  }

  /// Takes a report on the output that starts at `start`: downstream wants at most one picture per
  /// `interval`.
  void take_throttle(Nanoseconds start, Nanoseconds interval) {
    throttle_ = std::clamp(interval, Nanoseconds{0}, max_throttle);
    arrived(start);
  }

  /// Latency of downstream elements that they do not report.
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
    Nanoseconds lag;  ///< time that its frame waited upstream
    bool is_alone;    ///< nothing else is queued ahead of it downstream
  };

  /// Minimum number of reports, and time that they must cover, to learn a latency from.
  static constexpr int min_reports = 3;
  static constexpr Nanoseconds learning_time = 500 * ms;
  static constexpr Nanoseconds max_earliness = 20 * ms;

  struct Reports {
    Nanoseconds since = 0;
    int count = 0;
    Nanoseconds min_lateness = 0;
    Nanoseconds max_lateness = 0;
  };

  /// Returns the picture that starts at `start`, and removes it and all before it from in_flight_.
  std::optional<Picture> arrived(Nanoseconds start) {
    std::optional<Picture> picture;
    for (; !in_flight_.empty() && in_flight_.front().start <= start; in_flight_.pop_front())
      picture = in_flight_.front();
    return picture;
  }

  /// True if a second picture is in flight although downstream should have started on the first.
  bool is_downstream_behind(Nanoseconds now) const {
    return in_flight_.size() >= 2 && now + latency_ > in_flight_.front().start + *due_after_;
  }

  /// Raises the latency if all pictures are late, and lowers it if all are early.
  void learn_latency(Nanoseconds lateness, Nanoseconds now) {
    if (reports_.count++ == 0) reports_ = {now, 1, lateness, lateness};
    reports_.min_lateness = std::min(reports_.min_lateness, lateness);
    reports_.max_lateness = std::max(reports_.max_lateness, lateness);
    if (reports_.count < min_reports || now - reports_.since < learning_time) return;
    if (reports_.min_lateness > 0)
      latency_ = std::min(latency_ + reports_.min_lateness, max_latency);
    else if (reports_.max_lateness < -max_earliness)
      latency_ = std::max(latency_ + reports_.max_lateness, Nanoseconds{0});
    reports_.count = 0;
  }

  Nanoseconds frame_ = 0;   ///< last frame
  Nanoseconds step_ = 0;    ///< from the previous frame to the last one
  Nanoseconds lag_ = 0;     ///< time that the last frame waited upstream
  Nanoseconds slack_ = 0;   ///< time that a frame may wait and still be shown in time
  Nanoseconds left_ = 0;    ///< when upstream could send the next frame
  Nanoseconds begun_ = 0;   ///< last processed frame
  Nanoseconds period_ = 0;  ///< from the previous processed frame to the last one
  Nanoseconds began_ = 0;   ///< when processing of that frame began
  Nanoseconds ended_ = 0;   ///< when it ended
  std::optional<Nanoseconds> usual_delay_;  ///< of frames that did not wait
  Nanoseconds throttle_ = 0;
  Nanoseconds wanted_from_ = 0;

  std::deque<Picture> in_flight_;         ///< not yet reported
  std::optional<Nanoseconds> due_after_;  ///< time from the start of a picture to its showing
  Reports reports_;
  Nanoseconds latency_ = 0;
};

}  // namespace eventcamera
