// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/pixel_solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "src/dvs/light_response.hpp"
#include "src/dvs/mismatch.hpp"
#include "src/dvs/shot_noise.hpp"

namespace eventcamera {
namespace {

constexpr double never = std::numeric_limits<double>::infinity();

/// Events cannot be told apart by less, microseconds.
constexpr double min_rest = 1;

/// More numbers than a pixel draws in a segment.
constexpr std::uint64_t draws_a_segment = 1 << 16;

/// What the light does to one pixel within a segment.
struct PixelSegment {
  Course signal;
  double last_signal;     ///< as the segment ends
  double expected_noise;  ///< 1/noise_unit
};

/// One pixel in one segment. Times are microseconds after the start of the segment.
class Pixel {
 public:
  Pixel(const DvsSettings& settings, const Random& random, const Segment& segment,
        PixelArray& pixels, int x, int y, const PixelSegment& course, EventCollector& events)
      : settings_(settings),
        random_(random),
        segment_(segment),
        pixels_(pixels),
        x_(x),
        y_(y),
        number_(pixels.number_of(x, y)),
        draw_(segment.number * draws_a_segment),
        events_(events),
        above_leak_(course.signal),
        reference_(pixels.reference.at(x, y)),
        positive_(pixels.positive.at(x, y)),
        negative_(pixels.negative.at(x, y)),
        leak_(pixels.leak.at(x, y) + segment.rise / segment.duration),
        ready_(pixels.rest.at(x, y)),
        released_(ready_),
        held_(settings.refractory_reset == RefractoryReset::signal && ready_ > 0),
        expected_noise_(course.expected_noise),
        quiet_(pixels.quiet.at(x, y)) {
    // That the reference falls, or the signal rises above it, is the same.
    above_leak_.slope += leak_;
    end_ = {segment.duration, course.last_signal + leak_ * segment.duration};
  }

  void pass() {
    const Crossings crossings(above_leak_, end_);
    CoursePoint now{0, above_leak_.offset + above_leak_.lag};
    int happened = 0;
    for (; happened < max_events; ++happened) {
      if (held_) {
        if (released_ > end_.t) break;
        now = at(released_);
        reference_ = now.value;
        held_ = false;
      }
      const double noise = next_noise();
      const auto crossing = crossings.first(reference_ - negative_, reference_ + positive_, now);
      if (noise <= (crossing ? crossing->point.t : end_.t)) {
        if (noise > now.t) now = at(noise);
        make_noise(now, noise);
      } else if (crossing) {
        now = crossing->point;
        cross(*crossing);
      } else {
        break;
      }
    }
    if (happened == max_events) reference_ = end_.value;
    skip_noise();
    keep();
  }

  /// The same, where the signal goes on a straight line and events are crossings and nothing more.
  void pass_straight() {
    const bool rises = above_leak_.slope > 0;
    const double step = rises ? positive_ : -negative_;
    const double last = end_.value + (rises ? rounding : -rounding);
    int happened = 0;
    for (; happened < max_events; ++happened) {
      const double level = reference_ + step;
      if (rises ? level > last : level < last) break;
      reference_ = level;
      const double t = std::clamp((level - above_leak_.offset) / above_leak_.slope, 0.0, end_.t);
      if (t < ready_) continue;
      events_.add(segment_.begin + t, x_, y_, rises ? Polarity::on : Polarity::off);
      ready_ = t + std::max(settings_.refractory_period, min_rest);
    }
    if (happened == max_events) reference_ = end_.value;
    keep();
  }

  bool is_straight() const { return above_leak_.lag == 0 && above_leak_.slope != 0; }

  /// The same, where events are crossings and nothing more.
  void pass_curved() {
    const Crossings crossings(above_leak_, end_);
    CoursePoint now{0, above_leak_.offset + above_leak_.lag};
    int happened = 0;
    for (; happened < max_events; ++happened) {
      const auto crossing = crossings.first(reference_ - negative_, reference_ + positive_, now);
      if (!crossing) break;
      now = crossing->point;
      reference_ += crossing->polarity == Polarity::on ? positive_ : -negative_;
      if (now.t < ready_) continue;
      events_.add(segment_.begin + now.t, x_, y_, crossing->polarity);
      ready_ = now.t + std::max(settings_.refractory_period, min_rest);
    }
    if (happened == max_events) reference_ = end_.value;
    keep();
  }

  /// The same, where one event of noise is all that happens; false, and nothing done, where more
  /// may. An event must not change the thresholds.
  bool pass_lone_noise() {
    const double t = next_noise();
    if (held_ || t < ready_ || t > end_.t) return false;
    const double first = above_leak_.offset + above_leak_.lag;
    const double farthest = std::abs(above_leak_.slope) * end_.t + std::abs(above_leak_.lag) +
                            2 * static_cast<double>(rounding);
    if (first + farthest >= reference_ + positive_ || first - farthest <= reference_ - negative_ ||
        farthest >= std::min(positive_, negative_))
      return false;
    const auto quiet = quiet_before_noise(random_, number_, Random::Purpose::course, draw_);
    if (quiet_ + quiet <= expected_noise_) return false;
    ++draw_;
    passed_noise_ = quiet_;
    quiet_ = quiet;
    set_off(above_leak_.at(t), t);
    keep();
    return true;
  }

 private:
  /// When the next event of shot noise comes; never, if not within this segment.
  double next_noise() const {
    const double then = passed_noise_ + quiet_;
    if (expected_noise_ < 1 || then > expected_noise_) return never;
    return segment_.duration * (then / expected_noise_);
  }

  CoursePoint at(double t) const { return {t, above_leak_.at(t)}; }

  void draw_noise() {
    passed_noise_ += quiet_;
    quiet_ = quiet_before_noise(random_, number_, Random::Purpose::course, draw_++);
  }

  /// `now` is not earlier than `t`.
  void make_noise(CoursePoint now, double t) {
    draw_noise();
    if (t >= ready_) set_off(now.value, t);
  }

  /// By noise, where the signal has this value.
  void set_off(double value, double t) {
    const bool is_on = (random_.bits(number_, Random::Purpose::course, draw_++) >> 63) != 0;
    reference_ = value;
    fire(t, is_on ? Polarity::on : Polarity::off);
  }

  void cross(const Crossing& crossing) {
    reference_ += crossing.polarity == Polarity::on ? positive_ : -negative_;
    if (crossing.point.t >= ready_) fire(crossing.point.t, crossing.polarity);
  }

  /// An event leaves, and the pixel rests.
  void fire(double crossed, Polarity polarity) {
    double t = crossed + settings_.latency;
    if (settings_.latency_jitter > 0) {
      const double jitter = random_.normal(number_, Random::Purpose::course, draw_++);
      t = std::max(crossed, t + settings_.latency_jitter * jitter);
    }
    if (!std::isinf(positive_)) events_.add(segment_.begin + t, x_, y_, polarity);
    released_ = t + settings_.refractory_period;
    ready_ = std::max(released_, t + min_rest);
    held_ = settings_.refractory_reset == RefractoryReset::signal;
    if (settings_.threshold_jitter > 0 && !std::isinf(positive_)) {
      const Mismatch mismatch(settings_, random_);
      positive_ = mismatch.next_positive_threshold(number_, draw_++);
      negative_ = mismatch.next_negative_threshold(number_, draw_++);
    }
  }

  /// What comes while the pixel is held, or has had enough, is lost. When the next comes after that
  /// does not hang on what came before.
  void skip_noise() {
    if (expected_noise_ < 1 || passed_noise_ + quiet_ > expected_noise_) return;
    draw_noise();
    passed_noise_ = expected_noise_;
  }

  void keep() {
    // As it lies below the signal when the next segment begins.
    pixels_.reference.at(x_, y_) = static_cast<float>(reference_ - leak_ * end_.t);
    pixels_.positive.at(x_, y_) = static_cast<float>(positive_);
    pixels_.negative.at(x_, y_) = static_cast<float>(negative_);
    const double rest = (held_ ? released_ : ready_) - end_.t;
    pixels_.rest.at(x_, y_) = static_cast<float>(std::max(0.0, rest));
    pixels_.quiet.at(x_, y_) = static_cast<std::uint32_t>(
        std::clamp(quiet_ - (expected_noise_ - passed_noise_), 1.0, 4294967294.0));
  }

  const DvsSettings& settings_;
  const Random& random_;
  const Segment& segment_;
  PixelArray& pixels_;
  int x_;
  int y_;
  std::uint64_t number_;
  std::uint64_t draw_;
  EventCollector& events_;

  Course above_leak_;  ///< the signal, beside a reference that does not leak
  CoursePoint end_{};
  double reference_;
  double positive_;
  double negative_;
  double leak_;      ///< a microsecond
  double ready_;     ///< not earlier does it fire again
  double released_;  ///< where the refractory period ends
  bool held_;        ///< in reset until then
  double expected_noise_;
  double passed_noise_ = 0;
  double quiet_;
};

}  // namespace

PixelTime::PixelTime(const DvsSettings& settings, const Random& random, const Segment& segment)
    : settings_(settings),
      random_(random),
      segment_(segment),
      is_plain_(settings.latency == 0 && settings.latency_jitter == 0 &&
                settings.threshold_jitter == 0 &&
                settings.refractory_reset == RefractoryReset::level) {}

void PixelTime::pass(PixelArray& pixels, int y, const Candidates& candidates,
                     const ShadeTables& tables, EventCollector& events) const {
  const auto pixel_of = [&](const Candidate& candidate) {
    const int x = candidate.x;
    const auto shade = static_cast<std::size_t>(candidate.shade);
    const double target = pixels.target.at(x, y);
    const auto course = settings_.cutoff_hz > 0
                            ? Course::low_pass(candidate.last_signal, candidate.last_target, target,
                                               segment_.duration, tables.bandwidth[shade])
                            : Course::line(candidate.last_target, target, segment_.duration);
    return Pixel(settings_, random_, segment_, pixels, x, y,
                 {course, pixels.signal.at(x, y), tables.expected_noise[shade]}, events);
  };
  if (!is_plain_) {
    for (const auto& candidate : candidates.quiet) pixel_of(candidate).pass();
    for (const auto& candidate : candidates.noisy) pixel_of(candidate).pass();
    return;
  }
  for (const auto& candidate : candidates.quiet) {
    auto pixel = pixel_of(candidate);
    if (pixel.is_straight())
      pixel.pass_straight();
    else
      pixel.pass_curved();
  }
  for (const auto& candidate : candidates.noisy)
    if (!pixel_of(candidate).pass_lone_noise()) pixel_of(candidate).pass();
}

}  // namespace eventcamera
