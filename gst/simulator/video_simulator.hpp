// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "gst/base/errors.hpp"
#include "gst/base/owned.hpp"
#include "src/render/palette.hpp"
#include "src/simulate/simulator.hpp"

/// An interval between two frames.
struct Interval {
  OwnedBuffer frame;  ///< frame that ends it
  eventcamera::Nanoseconds start = 0;
  eventcamera::Nanoseconds end = 0;
  std::optional<eventcamera::Nanoseconds> work_began{};  ///< on the frame
};

/// Ends the work on the frame of an interval, releases it, and pushes the events of the interval: a
/// GAP if there are none; nothing if `events` is null, after a first frame. Called by the element's
/// VideoSimulator, with the stream lock. May throw.
void event_simulator_push_interval(GObject* element, Interval interval,
                                   const eventcamera::EventBuckets* events);

/// Calls push_finished() of the simulator of this element, if it has one, with the stream lock.
/// Failures are reported, and drop the simulator.
void event_simulator_push_finished(GstElement* element);

/// Simulator of frames in buffers of any kind of memory. Called with the stream lock.
class VideoSimulator {
 public:
  virtual ~VideoSimulator() = default;

  /// Sets the format of the next frames. Size and depth must stay the same.
  virtual void set_video(const GstVideoInfo& video) = 0;

  /// Sets the format of the next pictures.
  virtual void set_drawn_video(const GstVideoInfo& drawn) = 0;

  /// Simulates the interval, and calls event_simulator_push_interval() before it returns or, if the
  /// events are ready later, from a later call, in order. Throws VideoSimulatorError as well.
  virtual void push(Interval interval, const eventcamera::Settings& settings) = 0;

  /// Draws the events until `frame` in the buffer `picture` (none for a first frame). Throws
  /// VideoSimulatorError as well.
  virtual void draw(OwnedBuffer frame, eventcamera::Nanoseconds time,
                    const eventcamera::Settings& settings, const eventcamera::Palette& palette,
                    GstBuffer* picture) = 0;

  /// Pushes the finished intervals, and releases frames that have been read.
  virtual void push_finished() {}

  /// Waits for the pending intervals, and pushes them.
  virtual void finish() {}

  /// Forgets the pending intervals.
  virtual void drop() {}

  virtual eventcamera::IntervalSimulator& simulator() = 0;
};

/// Failure with its own message.
class VideoSimulatorError : public std::runtime_error {
 public:
  VideoSimulatorError(Report report, const std::string& cause)
      : std::runtime_error(cause), report_(std::move(report)) {}

  const Report& report() const { return report_; }

 private:
  Report report_;
};

/// Error for a frame that does not match its caps.
inline VideoSimulatorError cannot_read(const std::string& fault) {
  return {{GST_RESOURCE_ERROR_FAILED,
           "Cannot read a video frame: " + fault + ". Check the element upstream."},
          fault};
}

/// Error for an output buffer that does not match its caps.
inline VideoSimulatorError cannot_draw(const std::string& fault) {
  return {{GST_RESOURCE_ERROR_FAILED,
           "Cannot draw into an output buffer: " + fault + ". Check the element downstream."},
          fault};
}
