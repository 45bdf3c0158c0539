// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>
#include <gst/video/video.h>

#include <array>
#include <memory>
#include <optional>

#include "gst/base/errors.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/owned.hpp"
#include "gst/simulator/class_images.hpp"
#include "gst/simulator/eventsimulator.hpp"
#include "gst/simulator/flow_tensor.hpp"
#include "gst/simulator/frame_clock.hpp"
#include "gst/simulator/frame_timing.hpp"
#include "gst/simulator/input_warnings.hpp"
#include "gst/simulator/properties.hpp"
#include "gst/simulator/video_simulator.hpp"

GST_DEBUG_CATEGORY_EXTERN(event_simulator_debug);

/// The stream of a simulator element: takes frames, simulates the intervals between them, and
/// pushes events or pictures. A failure is reported, and drops the simulator; the next frame makes
/// another.
///
/// Called with the stream lock of the sink pad, or while there is no streaming thread.
class StreamSimulation {
 public:
  explicit StreamSimulation(GstEventSimulator* element)
      : timing(GST_BASE_TRANSFORM(element), event_simulator_debug),
        element_(GST_BASE_TRANSFORM(element)) {}

  /// Makes a simulator of video `in`, unless there is one, with output `out`. False, after an error
  /// message, if there is none.
  bool set_caps(GstCaps* in, GstCaps* out);

  /// Processes a frame and outputs the interval that it ends, if any.
  GstFlowReturn take_frame(OwnedBuffer frame);
  /// Handles a GAP from upstream: holds the last frame until one frame duration before the end of
  /// the gap, where the next interval begins; for drawn video, only forwards the gap. Returns true
  /// if the event must be forwarded.
  bool take_gap(GstEvent* event);
  /// Pushes the events of an interval, as event_simulator_push_interval(). May throw.
  void push_interval(Interval interval, const eventcamera::EventBuckets* events);
  /// Pushes the intervals that are finished.
  void push_finished();
  /// Finishes and pushes all pending intervals.
  void finish();

  /// Starts a new timeline, discontinuous with the previous one.
  void start_timeline();
  /// No frames follow.
  void end();
  /// Drops the simulator and all state, on stop.
  void reset();

  std::array<CompanionPad*, 2> companions() { return {&class_images, &flow_tensors}; }

  // Accessed by any thread.
  Guarded<SimulatorSettings> settings;
  FrameTiming timing;
  ClassImages class_images{event_simulator_debug};
  FlowTensors flow_tensors{event_simulator_debug};

 private:
  /// State from caps to stop.
  struct State {
    GstVideoInfo video;  ///< input format
    std::unique_ptr<VideoSimulator> frames;
    bool draws = false;  ///< the output is video, not events

    eventcamera::IntervalSimulator& simulator() const { return frames->simulator(); }
  };

  /// State from start to stop, independent of caps.
  struct Stream {
    std::optional<eventcamera::Nanoseconds>
        handed_out_until;              ///< end of the segment's last interval
    bool discontinuous = false;        ///< the next buffer is discontinuous
    GstFlowReturn flow = GST_FLOW_OK;  ///< result of the last push
    FrameClock clock{event_simulator_debug};
    InputWarnings warnings{event_simulator_debug};
    WarnOnce warn_of_times{event_simulator_debug};
  };

  const EventSimulatorMethod& method() const {
    return *GST_EVENT_SIMULATOR_GET_CLASS(element_)->method;
  }

  template <class Work>
  void reported(const Work& work);
  bool ensure_state();

  void configure();
  SimulatorSettings begin_interval();
  void sync_controlled_properties(GstClockTime time);
  void advance_companions(GstClockTime time);
  bool accept_time(GstBuffer* frame);
  void warn_of_times(const char* what);
  void forget_frames();
  void start_over();
  void simulate(OwnedBuffer frame);
  GstFlowReturn draw_frame(const SimulatorSettings& current, eventcamera::Nanoseconds time,
                           OwnedBuffer frame);
  void hold_until(eventcamera::Nanoseconds end, guint32 seqnum);

  GstFlowReturn write_events(const eventcamera::EventBuckets& events, GstBuffer* frame,
                             eventcamera::Nanoseconds start, eventcamera::Nanoseconds end,
                             OwnedBuffer& out);
  GstFlowReturn push_gap(eventcamera::Nanoseconds start, eventcamera::Nanoseconds end,
                         guint32 seqnum);
  GstFlowReturn push_buffer(OwnedBuffer out, GstClockTime pts, GstClockTime duration);

  GstBaseTransform* element_;
  std::optional<State> state_;
  Stream stream_;
};
