// SPDX-License-Identifier: LGPL-2.1-or-later
// A simulator that has no time for all frames, between a live source and a sink in virtual time.
#include "src/simulate/frame_pacer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <random>
#include <vector>

#include "src/simulate/learnt_latency.hpp"

namespace {

using namespace eventcamera;

constexpr Nanoseconds second = 1'000'000'000;

/// A live source, a simulator and a video sink, in virtual time.
class Overload {
 public:
  using Time = Nanoseconds;

  static constexpr Time frame_duration = second / 30;

  /// Times for a picture, in ms: in the simulator, downstream, and for a frame upstream.
  struct Work {
    int simulator;
    int downstream;
    int upstream = 0;
    bool varies = false;  ///< in the simulator: from half to many times as much
  };

  Overload(Work work, bool has_queue)
      : work_(work.simulator * one_ms),
        downstream_(work.downstream * one_ms),
        upstream_(work.upstream * one_ms),
        varies_(work.varies),
        has_queue_(has_queue) {
    processing_.expect(0);
  }

  /// Times at which pictures are shown.
  std::vector<Time> play(Time duration) {
    for (Time frame = 0; frame < duration; frame += frame_duration) {
      now_ = std::max(now_, frame) + upstream_;
      report();
      if (pacer_.skip(frame, now_)) continue;
      pacer_.begin(frame);
      const Time work = work_now();
      now_ += work;
      processing_.add(frame, work / deadline * deadline);
      push(frame, std::max(frame_duration, pacer_.period(now_)));
      report();
      pacer_.end(now_);
    }
    return shown_;
  }

  /// Shortest time from one picture to the next.
  Time period() const {
    const auto share = 1 - static_cast<double>(upstream_) / frame_duration;
    const auto first = static_cast<double>(has_queue_ ? work_ : work_ + downstream_) / share;
    return std::max({frame_duration, static_cast<Time>(first), downstream_});
  }

 private:
  static constexpr Time one_ms = second / 1000;
  static constexpr Time deadline = 20 * one_ms;

  struct Report {
    Time at;
    Time start;
    Time lateness;
  };

  void report() {
    for (; !reports_.empty() && reports_.front().at <= now_; reports_.pop_front())
      pacer_.take_lateness(reports_.front().start, reports_.front().lateness, reports_.front().at);
  }

  /// Time in the simulator, of which the mean is `work_`.
  Time work_now() {
    if (!varies_) return work_;
    std::uniform_real_distribution<> uniform(0.001, 1);
    return static_cast<Time>(static_cast<double>(work_) * (0.5 - 0.5 * std::log(uniform(random_))));
  }

  /// As GstVideoSink, which drops a picture that comes 5 ms after its end.
  void push(Time start, Time duration) {
    const Time due =
        start + upstream_ + processing_.value() + pacer_.downstream_latency() + deadline;
    const Time arrival = std::max(now_, sink_until_) + downstream_;
    const Time shown = std::max(arrival, due);
    if (shown <= due + duration + 5 * one_ms) shown_.push_back(shown);
    sink_until_ = shown;
    reports_.push_back({shown, start, arrival - due});
    if (!has_queue_) now_ = shown;
  }

  FramePacer pacer_;
  LearntLatency processing_;
  Time work_;
  Time downstream_;
  Time upstream_;
  bool varies_;
  std::mt19937 random_{1};
  bool has_queue_;
  Time now_ = 0;
  Time sink_until_ = 0;
  std::deque<Report> reports_;
  std::vector<Time> shown_;
};

/// Plays a minute, of which the first second is for learning. Expects 80 % of the pictures that
/// there is time for, at even distances: 95 % of them within `periods`, and a frame.
void expect_shown(Overload::Work work, double periods = 1.5) {
  for (const bool has_queue : {false, true}) {
    SCOPED_TRACE(testing::Message()
                 << work.upstream << " ms, " << work.simulator << " ms, " << work.downstream
                 << (has_queue ? " ms in two threads" : " ms in one thread"));
    Overload overload(work, has_queue);
    const auto period = overload.period();
    auto shown = overload.play(60 * second);
    EXPECT_GE(static_cast<double>(shown.size()), 0.8 * static_cast<double>(59 * second / period));
    ASSERT_GT(shown.size(), 20U);
    for (std::size_t i = shown.size() - 1; i > 0; --i) shown[i] -= shown[i - 1];
    std::sort(shown.begin() + 1, shown.end());
    EXPECT_LE(static_cast<double>(shown[shown.size() * 95 / 100] - Overload::frame_duration),
              periods * static_cast<double>(period));
  }
}

TEST(FramePacer, ShowsMostOfWhatCanBeComputedEvenly) {
  for (const int work : {5, 20, 30, 35, 50, 70, 100, 250, 400})
    for (const int downstream : {0, 2, 15, 40, 100}) expect_shown({work, downstream});
}

TEST(FramePacer, ShowsMostIfUpstreamTakesTimeForSkippedFrames) {
  for (const int work : {50, 70, 100, 250, 400})
    for (const int upstream : {2, 5, 8}) expect_shown({work, 2, upstream});
}

TEST(FramePacer, ShowsMostIfSomePicturesTakeLonger) {
  for (const int work : {20, 50, 70, 100, 250, 400})
    for (const int downstream : {0, 2, 15}) expect_shown({work, downstream, 0, true}, 2);
}

TEST(FramePacer, SkipsNothingWithoutReports) {
  FramePacer pacer;
  for (int i = 0; i < 200; ++i) {
    EXPECT_FALSE(pacer.skip(i * Overload::frame_duration, i * second));
    pacer.begin(i * Overload::frame_duration);
    pacer.end((i + 1) * second);
  }
}

TEST(FramePacer, GoesOnWhereReportsCease) {
  FramePacer pacer;
  pacer.skip(0, 0);
  pacer.begin(0);
  pacer.end(0);
  pacer.take_lateness(0, 0, 0);
  int processed = 0;
  for (int i = 1; i <= 300; ++i) {
    const auto now = i * Overload::frame_duration;
    if (pacer.skip(now, now)) continue;
    pacer.begin(now);
    pacer.end(now);
    ++processed;
  }
  EXPECT_GT(processed, 260);  // all but those of a second
}

}  // namespace
