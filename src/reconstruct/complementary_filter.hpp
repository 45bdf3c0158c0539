// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "src/core/event.hpp"
#include "src/core/event_validator.hpp"
#include "src/core/image.hpp"

namespace eventcamera {

/// Complementary filter of events and grey frames: brightness at any time, with fast changes from
/// the events and slow changes from the frames (Scheerlinck, Barnes and Mahony, ACCV 2018). See
/// docs/reconstruction.md. Events and frames must be passed in time order.
class ComplementaryFilter {
 public:
  struct Settings {
    double cutoff = 2;                 ///< between events and frames, Hz; 0 = events only
    double positive_threshold = 0.26;  ///< change of log(grey level + offset) by an event
    double negative_threshold = 0.26;

    friend bool operator==(const Settings&, const Settings&) = default;
  };

  /// Starts with a frame.
  ComplementaryFilter(const ImageView<std::uint8_t>& frame, Microseconds t,
                      const Settings& settings);

  void configure(const Settings& settings);
  /// Like Renderer::add(), without allocating.
  InvalidEvents add(std::span<const Event> events, Microseconds start, Microseconds max_t);
  void set_frame(const ImageView<std::uint8_t>& frame, Microseconds t);
  /// Draws the brightness at a time. `stride` in bytes.
  void draw(Microseconds t, std::byte* picture, std::ptrdiff_t stride) const;

 private:
  double exponent(Microseconds t) const {
    return t > origin_ ? rate_ * static_cast<double>(t - origin_) : 0;
  }
  void decay_to(Microseconds t);

  double rate_ = 0;  ///< of the decay, per microsecond
  float on_ = 0;
  float off_ = 0;
  EventValidator validator_;
  Microseconds last_ = 0;         ///< time of steps_
  std::array<float, 2> steps_{};  ///< of an OFF and of an ON event
  Microseconds origin_;           ///< time of differences_
  Image<float> frame_;            ///< response to the last frame
  /// State minus frame_ at origin_. All pixels decay alike, so later changes are scaled up instead.
  Image<float> differences_;
};

}  // namespace eventcamera
