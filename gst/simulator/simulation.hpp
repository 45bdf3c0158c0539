// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>
#include <gst/video/video.h>

#include <atomic>
#include <deque>
#include <memory>
#include <optional>

#include "gst/base/properties.hpp"
#include "gst/simulator/eventsimulator.hpp"
#include "gst/simulator/repeated_frames.hpp"
#include "src/core/image.hpp"

GST_DEBUG_CATEGORY_EXTERN(event_simulator_debug);

/// User-settable values, copied once per frame.
struct SimulatorSettings {
  eventcamera::Settings simulation;
  eventcamera::PaletteName palette = eventcamera::PaletteName::dark;
  bool write_flow = false;     ///< add the flow of each interval to its buffer
  bool skip_repeated = false;  ///< compare pictures to find repeated frames
};

struct SimulatorStats {
  guint64 frames = 0;
  guint64 skipped_frames = 0;
  guint64 repeated_frames = 0;
  guint64 processing_time = 0;  ///< ns
};

/// Duration of the intervals of a stream, which is the latency of their events. Starts with the
/// caps' duration. Rises to the second longest of the last intervals, so that one pause does not
/// delay the rest of the stream; falls once all of the last intervals are clearly shorter. Ignores
/// jitter.
class IntervalDuration {
 public:
  using Nanoseconds = eventcamera::Nanoseconds;

  /// Sets the duration according to the caps, which is the minimum; 0 if unknown.
  void expect(Nanoseconds duration);
  void add(Nanoseconds duration);
  Nanoseconds value() const { return value_; }

 private:
  static constexpr std::size_t max_count = 8;
  static constexpr Nanoseconds max = GST_SECOND;

  std::deque<Nanoseconds> last_;
  Nanoseconds expected_ = 0;
  Nanoseconds value_ = 0;
};

/// The stream of a simulator element: takes frames, simulates the intervals between them, and
/// pushes events or pictures. A failure is reported, and drops the simulator; the next frame makes
/// another.
///
/// GstBaseTransform calls all functions but the last ones under the stream lock of the sink pad.
class Simulation {
 public:
  using Nanoseconds = eventcamera::Nanoseconds;

  explicit Simulation(GstEventSimulator* element) : element_(GST_BASE_TRANSFORM(element)) {}

  /// Makes a simulator of video `in`, unless there is one, with output `out`. False, after an error
  /// message, if there is none.
  bool set_caps(GstCaps* in, GstCaps* out);

  /// Simulates the interval that a frame ends, if any, and pushes the finished intervals.
  GstFlowReturn push_frame(OwnedBuffer frame);
  /// The next interval is longer, because the frame at `pts` was skipped.
  void skip_frame(GstClockTime pts);
  /// The next frame, at `pts`, does not continue from the last one.
  void interrupt(GstClockTime pts);
  /// Handles a GAP of the video: the last frame is held through it once a frame follows that is not
  /// earlier than its end, because a GAP can overtake frames that a decoder still holds. Returns
  /// false if the event must be forwarded instead: for drawn video, and before a first frame.
  bool hold_through(GstEvent* gap);
  /// Warns if tags say that the video is rotated.
  void check_orientation(GstEvent* tags);
  /// Finishes and pushes the pending interval.
  void finish();
  /// Finishes the stream, with the events of the last gap and of late rows.
  void end();

  /// Starts a new timeline, discontinuous with the previous one.
  void start_timeline();
  /// Drops the simulator and all state, on stop.
  void reset();

  // For any thread.

  /// Events arrive this much after the start of their interval; pictures replace their frame.
  GstClockTime latency() const { return draws_ ? 0 : interval_.load(); }
  GstClockTime interval() const { return interval_; }

  Guarded<SimulatorSettings> settings;
  Guarded<SimulatorStats> stats;

 private:
  /// State from caps to stop.
  struct State {
    GstVideoInfo video;  ///< input format
    std::unique_ptr<VideoSimulator> frames;
    bool draws = false;                            ///< the output is video, not events
    eventcamera::Image<eventcamera::Flow> flow{};  ///< KnownFlow is a view of it

    eventcamera::IntervalSimulator& simulator() const { return frames->simulator(); }
  };

  struct Gap {
    GstClockTime start;
    GstClockTime end;
    guint32 seqnum;
  };

  struct UnrefBytes {
    void operator()(GBytes* bytes) const { g_bytes_unref(bytes); }
  };

  /// State from start to stop, independent of caps.
  struct Stream {
    std::optional<Nanoseconds> pushed_until;     ///< end of the segment's last interval
    bool discontinuous = false;                  ///< the next buffer is discontinuous
    GstFlowReturn flow = GST_FLOW_OK;            ///< result of the last push
    std::optional<Gap> gap;                      ///< since the last frame
    std::unique_ptr<GBytes, UnrefBytes> motion;  ///< known, from the last frame to the next one
    std::optional<GstClockTime> next_time;       ///< end of the last frame
    std::optional<GstClockTime> last_pts;        ///< of the last frame
    GstClockTime last_duration = 0;  ///< of the last frame, GST_CLOCK_TIME_NONE = unknown
    RepeatedFrames repeated;
    OwnedBuffer picture;          ///< drawn last, for repeated frames
    std::optional<bool> is_live;  ///< upstream's answer, once asked
    IntervalDuration interval;
    WarnOnce warn_of_no_pts{event_simulator_debug};
    WarnOnce warn_of_times{event_simulator_debug};
    WarnOnce warn_of_equal_times{event_simulator_debug};
    WarnOnce warn_of_long_gap{event_simulator_debug};
    WarnOnce warn_of_interlacing{event_simulator_debug};
    WarnOnce warn_of_bare_file{event_simulator_debug};
    WarnOnce warn_of_orientation{event_simulator_debug};
  };

  const EventSimulatorMethod& method() const {
    return *GST_EVENT_SIMULATOR_GET_CLASS(element_)->method;
  }

  template <class Work>
  void reported(const Work& work);
  template <class Work>
  auto timed(const Work& work);
  bool ensure_state();
  bool is_live();
  void update_latency(GstClockTime before);

  OwnedBuffer with_time(OwnedBuffer frame);
  std::optional<GstClockTime> time_of_arrival();
  Nanoseconds time_of(GstBuffer* frame);
  const char* fault_of_time(Nanoseconds time) const;
  void check_interlacing(GstBuffer* frame);
  void check_sink();
  void warn_of_times(const char* what);
  void sync_controlled_properties(GstClockTime time);
  SimulatorSettings begin_interval();
  KnownFlow known_flow();
  void keep_flow(GstBuffer* frame);

  void forget_frames(GstClockTime next = GST_CLOCK_TIME_NONE);
  void start_over(GstClockTime next = GST_CLOCK_TIME_NONE);
  void simulate(OwnedBuffer frame);
  void draw_frame(const SimulatorSettings& current, const KnownFlow& flow, OwnedBuffer frame);
  void repeat(GstBuffer* frame, Nanoseconds time);
  void hold_last_frame(GstClockTime next);
  void hold_until(Nanoseconds end, guint32 seqnum);

  void push_interval(std::optional<Interval> interval);
  void push_late_events(GstClockTime next = GST_CLOCK_TIME_NONE);
  GstFlowReturn write_events(const eventcamera::EventBuckets& events, GstBuffer* frame,
                             OwnedBuffer& out);
  GstFlowReturn push_gap(Nanoseconds start, Nanoseconds end, guint32 seqnum);
  GstFlowReturn push_buffer(OwnedBuffer out, GstClockTime pts, GstClockTime duration);

  GstBaseTransform* element_;
  std::optional<State> state_;
  Stream stream_;
  std::atomic<GstClockTime> interval_ = 0;
  std::atomic<bool> draws_ = false;
};
