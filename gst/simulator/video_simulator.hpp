// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "gst/base/errors.hpp"
#include "gst/base/owned.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/render/palette.hpp"
#include "src/simulate/simulator.hpp"

struct Interval {
  OwnedBuffer frame;  ///< frame that ends it
  eventcamera::Nanoseconds start;
  eventcamera::Nanoseconds end;
  /// Null until it is finished. Valid until the next call of the simulator.
  const eventcamera::EventBuckets* events = nullptr;
};

/// Motion from the last frame to this one, if it is known.
using KnownFlow = std::optional<eventcamera::ImageView<eventcamera::Flow>>;

/// Simulator of frames in buffers of any kind of memory. push(), draw() and finish() throw
/// VideoSimulatorError and the exceptions of the simulator.
class VideoSimulator {
 public:
  virtual ~VideoSimulator() = default;

  /// Sets the format of the next frames. Size and depth must stay the same.
  virtual void set_video(const GstVideoInfo& video) = 0;

  virtual void set_drawn_video(const GstVideoInfo& drawn) = 0;

  /// Simulates an interval; for a first frame, it is empty. Returns the interval that is finished,
  /// if any: this one or, if another processor is still working on it, the one before.
  virtual std::optional<Interval> push(Interval interval, const eventcamera::Settings& settings,
                                       const KnownFlow& flow) = 0;

  /// Draws the events until `frame` in the buffer `picture` (none for a first frame).
  virtual void draw(OwnedBuffer frame, eventcamera::Nanoseconds time,
                    const eventcamera::Settings& settings, const KnownFlow& flow,
                    const eventcamera::Palette& palette, GstBuffer* picture) = 0;

  /// Waits for the last interval, and returns it unless push() did.
  virtual std::optional<Interval> finish() { return std::nullopt; }

  virtual void drop() {}

  virtual const eventcamera::EventBuckets* hold_until(eventcamera::Nanoseconds time,
                                                      const eventcamera::Settings& settings) {
    return simulator().hold_until(time, settings);
  }

  virtual eventcamera::IntervalSimulator& simulator() = 0;
};

class VideoSimulatorError : public std::runtime_error {
 public:
  VideoSimulatorError(Report report, const std::string& cause)
      : std::runtime_error(cause), report_(std::move(report)) {}

  const Report& report() const { return report_; }

 private:
  Report report_;
};
