// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/stream_simulation.hpp"

#include <algorithm>
#include <new>
#include <string>
#include <utility>

#include "gst/base/pads.hpp"
#include "gst/base/video_frame.hpp"
#include "gst/simulator/buffers.hpp"
#include "gst/simulator/caps.hpp"
#include "gst/simulator/frame_luma.hpp"

#define GST_CAT_DEFAULT event_simulator_debug

using eventcamera::EventBuckets;
using eventcamera::Nanoseconds;

/* failures */

static Report report_of(const std::exception& error, const std::string& no_memory,
                        const char* otherwise) {
  if (is_a<std::bad_alloc>(error)) return {GST_RESOURCE_ERROR_NO_SPACE_LEFT, no_memory};
  if (const auto* known = dynamic_cast<const VideoSimulatorError*>(&error)) return known->report();
  return {GST_STREAM_ERROR_FAILED, otherwise};
}

/// Runs `work`; reports any exception and drops the state, because the simulator is then unusable.
/// The next output, if any, is discontinuous.
template <class Work>
void StreamSimulation::reported(const Work& work) {
  const auto failure = [this](const std::exception& error) {
    state_.reset();
    stream_.discontinuous = true;
    return report_of(error, "Not enough memory for the events of a frame. Raise the thresholds.",
                     "The simulation failed.");
  };
  if (!catch_exceptions(element_, failure, work)) stream_.flow = GST_FLOW_ERROR;
}

/* negotiation */

bool StreamSimulation::set_caps(GstCaps* in, GstCaps* out) {
  finish();
  GstVideoInfo video;
  GstVideoInfo drawn;
  if (!gst_video_info_from_caps(&video, in) ||
      (event_simulator_draws(out) && !gst_video_info_from_caps(&drawn, out))) {
    GST_ERROR_OBJECT(element_, "cannot make %" GST_PTR_FORMAT " from %" GST_PTR_FORMAT, out, in);
    return false;
  }
  const auto luma = FrameLuma::format_of(video);
  const auto failure = [&](const std::exception& error) {
    state_.reset();
    return report_of(error,
                     "Not enough memory for frames of " + std::to_string(luma.width) + "x" +
                         std::to_string(luma.height) + " pixels.",
                     "Cannot simulate this video.");
  };
  const bool made = catch_exceptions(element_, failure, [&] {
    if (!state_ || FrameLuma::format_of(state_->video) != luma) {
      if (state_ && state_->simulator().last_time()) stream_.discontinuous = true;
      state_.reset();  // before allocating the next: frames can be large
      state_.emplace(State{.video = video, .frames = method().create(G_OBJECT(element_), video)});
    } else {
      state_->video = video;
      state_->frames->set_video(video);
    }
    state_->draws = event_simulator_draws(out);
    if (state_->draws) state_->frames->set_drawn_video(drawn);
  });
  if (!made) return false;
  GST_DEBUG_OBJECT(element_, "%s of %" GST_PTR_FORMAT, state_->draws ? "event frames" : "events",
                   in);
  // Pictures have the time of their frame, intervals that of the previous frame.
  const GstClockTime duration = state_->draws ? 0 : frame_duration(video);
  if (duration > 0 || state_->draws) timing.expect(static_cast<Nanoseconds>(duration));
  timing.qos().lock()->take_output(state_->draws);
  return true;
}

/// Ensures that there is a state. Errors drop it while the pads keep their caps; if the application
/// continues, it is recreated from these. False if that fails.
bool StreamSimulation::ensure_state() {
  if (state_) return true;
  const OwnedCaps in(gst_pad_get_current_caps(GST_BASE_TRANSFORM_SINK_PAD(element_)));
  const OwnedCaps out(gst_pad_get_current_caps(GST_BASE_TRANSFORM_SRC_PAD(element_)));
  return in && out && set_caps(in.get(), out.get());
}

/* settings */

/// Passes the settings of the method to the simulator.
void StreamSimulation::configure() {
  if (const auto configure = method().configure) configure(state_->simulator(), G_OBJECT(element_));
}

/// Configures the simulator for the next interval, and returns the settings of that.
SimulatorSettings StreamSimulation::begin_interval() {
  configure();
  SimulatorSettings current = settings.copy();
  if (class_images.pad()) current.simulation.labels = true;
  if (state_->draws) current.simulation.labels = false;
  return current;
}

/// Restores the state that a timeline continues from, if any, before its first frame or GAP. May
/// throw.
void StreamSimulation::restore_at_start() {
  if (!stream_.continuation.begins() || method().restore == nullptr) return;
  auto& simulator = state_->simulator();
  configure();
  method().restore(simulator, G_OBJECT(element_));
  stream_.continuation.restored(simulator.last_time());
  if (const auto time = simulator.last_time()) extend_segment(static_cast<GstClockTime>(*time));
}

/// Lets the segment begin at `start`, if that is earlier; times in it stay what they are. Sinks
/// drop what begins before, as the first interval after a state does in a clip of its own.
void StreamSimulation::extend_segment(GstClockTime start) {
  GstSegment& segment = element_->segment;
  if (segment.format != GST_FORMAT_TIME || start >= segment.start) return;
  const guint64 earlier = segment.start - start;
  segment.start = start;
  segment.offset += earlier;
  if (GST_CLOCK_TIME_IS_VALID(segment.time)) segment.time -= std::min(segment.time, earlier);
  GstPad* const src = GST_BASE_TRANSFORM_SRC_PAD(element_);
  const OwnedEvent last(gst_pad_get_sticky_event(src, GST_EVENT_SEGMENT, 0));
  GstEvent* const extended = gst_event_new_segment(&segment);
  if (last) gst_event_set_seqnum(extended, gst_event_get_seqnum(last.get()));
  gst_pad_push_event(src, extended);
}

/// Updates controlled properties to their values at `time`, a timestamp of the segment.
void StreamSimulation::sync_controlled_properties(GstClockTime time) {
  const GstSegment& segment = element_->segment;
  if (segment.format != GST_FORMAT_TIME) return;  // before the first segment
  const auto stream_time = gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, time);
  if (GST_CLOCK_TIME_IS_VALID(stream_time))
    gst_object_sync_values(GST_OBJECT(element_), stream_time);
}

/// Lets class images and flow follow the video up to a time, also past frames that are skipped.
/// What the interval since the last frame may need is kept.
void StreamSimulation::advance_companions(GstClockTime time) {
  const GstSegment& segment = element_->segment;
  const auto last = state_->simulator().last_time();
  const auto from = running_time_of(
      segment, std::min(time, static_cast<GstClockTime>(last.value_or(Nanoseconds{G_MAXINT64}))));
  const auto until = running_time_of(segment, time);
  if (from && until)
    for (auto* companion : companions()) companion->advance(*from, *until);
}

/* discontinuities */

/// Makes the next frame a first frame. May throw.
void StreamSimulation::forget_frames() {
  if (!state_) return;
  state_->frames->finish();
  if (!state_->simulator().last_time()) return;
  GST_DEBUG_OBJECT(element_, "the next frame begins an interval; the last was at %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(static_cast<GstClockTime>(*state_->simulator().last_time())));
  state_->simulator().reset();
  stream_.discontinuous = true;
}

/// Restarts at a first frame, for a new timeline. May throw.
void StreamSimulation::start_over() {
  forget_frames();
  stream_.handed_out_until.reset();
}

void StreamSimulation::start_timeline() {
  if (state_) state_->frames->drop();
  stream_.flow = GST_FLOW_OK;
  reported([&] { start_over(); });
  stream_.continuation = {};
  for (auto* companion : companions()) companion->begin();
  stream_.clock.start_over();
  timing.qos().lock()->start_over();
}

void StreamSimulation::warn_of_times(const char* what) {
  stream_.warn_of_times(
      element_,
      {GST_STREAM_ERROR_FORMAT, std::string("Bad video timestamps: ") + what +
                                    ". No events are simulated across this point; videorate or a "
                                    "parser upstream can repair timestamps."},
      "an interval needs a PTS at both ends");
}

/// Takes the time of a frame: forgets the frames that it does not continue. False if the frame must
/// be skipped. May throw.
bool StreamSimulation::accept_time(GstBuffer* frame) {
  const GstClockTime pts = GST_BUFFER_PTS(frame);
  const bool continues = stream_.continuation.continues();
  if (GST_BUFFER_IS_DISCONT(frame) && !continues) {
    start_over();
    stream_.discontinuous = true;
  }
  if (pts > G_MAXINT64) {
    warn_of_times("the PTS of a frame is out of range");
    forget_frames();
    return false;
  }
  const auto time = static_cast<Nanoseconds>(pts);
  const auto last = state_->simulator().last_time();
  if (last && time <= *last) {
    warn_of_times("a frame is not later than the previous one");
    forget_frames();
  } else if (last && time - *last < Nanoseconds{event_resolution}) {
    warn_of_times("two frames are less than a microsecond apart");
    forget_frames();
  } else if (last && time - *last > eventcamera::max_interval) {
    warn_of_times("two frames are more than 71 minutes apart");
    forget_frames();
  }
  // An interval starting with this frame would overlap the last one.
  const auto until = stream_.handed_out_until;
  if (!until || time >= *until) return true;
  GST_LOG_OBJECT(element_,
                 "skipping the frame at %" GST_TIME_FORMAT ": events until %" GST_TIME_FORMAT
                 " were sent",
                 GST_TIME_ARGS(pts), GST_TIME_ARGS(static_cast<GstClockTime>(*until)));
  return false;
}

/* frames in */

GstFlowReturn StreamSimulation::take_frame(OwnedBuffer frame) {
  auto& flow = stream_.flow;
  // Since output was pushed outside of this function, downstream may have been relinked.
  if (flow != GST_FLOW_EOS && flow != GST_FLOW_ERROR) {
    flow = GST_FLOW_OK;
    if (!ensure_state()) return GST_FLOW_NOT_NEGOTIATED;
    if (stream_.clock.stamp(element_, state_->video, frame))
      reported([&] { simulate(std::move(frame)); });
  }
  return std::exchange(flow, GST_FLOW_OK);
}

/// Simulates the interval that a frame with a PTS ends, if any. May throw.
void StreamSimulation::simulate(OwnedBuffer frame) {
  const GstClockTime pts = GST_BUFFER_PTS(frame.get());
  sync_controlled_properties(pts);
  stream_.warnings.check_interlacing(element_, state_->video, frame.get());
  restore_at_start();
  advance_companions(pts);
  if (stream_.continuation.is_after(pts)) {
    GST_LOG_OBJECT(element_, "skipping the frame at %" GST_TIME_FORMAT ": the state is later",
                   GST_TIME_ARGS(pts));
    return;
  }
  if (!accept_time(frame.get())) return;
  auto& simulator = state_->simulator();
  const auto start = simulator.last_time();
  if (!timing.begin(frame.get(), start.has_value())) return;
  const auto end = static_cast<Nanoseconds>(pts);
  const SimulatorSettings current = begin_interval();
  if (start && !flow_tensors.give(GST_ELEMENT(element_), simulator, element_->segment,
                                  state_->video, *start, end)) {
    stream_.flow = GST_FLOW_FLUSHING;
    return;
  }
  if (state_->draws) {
    stream_.handed_out_until = end;
    stream_.flow = draw_frame(current, end, std::move(frame));
    return;
  }
  if (start) stream_.handed_out_until = end;
  state_->frames->push({std::move(frame), start.value_or(end), end, timing.began()},
                       current.simulation);
}

/// Draws the events since the last frame (none for a first frame). The picture replaces the frame,
/// at its `time`. May throw.
GstFlowReturn StreamSimulation::draw_frame(const SimulatorSettings& current, Nanoseconds time,
                                           OwnedBuffer frame) {
  OwnedBuffer picture;
  GstFlowReturn result = event_simulator_make_picture(element_, frame.get(), picture);
  if (result == GST_FLOW_OK) {
    GST_BUFFER_DURATION(picture.get()) = GST_BUFFER_DURATION(frame.get());
    state_->frames->draw(std::move(frame), time, current.simulation,
                         eventcamera::palette(current.palette), picture.get());
  }
  timing.end_work(time, timing.began());
  if (result != GST_FLOW_OK) return result;
  timing.qos().lock()->extend(element_, picture.get(), frame_duration(state_->video));
  const GstClockTime duration = GST_BUFFER_DURATION(picture.get());
  result = push_buffer(std::move(picture), static_cast<GstClockTime>(time), duration);
  timing.end();
  return result;
}

bool StreamSimulation::take_gap(GstEvent* event) {
  GstClockTime pts = GST_CLOCK_TIME_NONE;
  GstClockTime duration = GST_CLOCK_TIME_NONE;
  gst_event_parse_gap(event, &pts, &duration);
  if (!state_) return true;
  reported([&] { restore_at_start(); });
  if (!state_) return false;  // after an error
  const bool has_end = GST_CLOCK_TIME_IS_VALID(duration) && pts <= G_MAXINT64;
  advance_companions(pts + (has_end ? std::min(duration, G_MAXINT64 - pts) : 0));
  const auto start = state_->simulator().last_time();
  if (!start || state_->draws) return true;
  // The next frame must come later, by an interval if that is known.
  const auto frame = static_cast<GstClockTime>(timing.interval());
  const GstClockTime rest =
      GST_CLOCK_TIME_IS_VALID(duration) && frame > 0 && duration > frame ? duration - frame : 0;
  if (pts > G_MAXINT64 || rest > G_MAXINT64 - pts) return false;
  const auto end = static_cast<Nanoseconds>(pts + rest);
  if (end <= *start) return false;
  reported([&] { hold_until(end, gst_event_get_seqnum(event)); });
  return false;
}

/// Holds the last frame until `end` and pushes the events of that time, and GAPs where there are
/// none. In parts, as a pixel has a maximum number of events in each. May throw.
void StreamSimulation::hold_until(Nanoseconds end, guint32 seqnum) {
  constexpr auto max_part = Nanoseconds{250 * GST_MSECOND};
  auto& simulator = state_->simulator();
  auto& flow = stream_.flow = GST_FLOW_OK;
  Nanoseconds sent = *simulator.last_time();
  for (Nanoseconds start = sent; start < end && flow == GST_FLOW_OK;) {
    const Nanoseconds part_end = std::min(start + max_part, end);
    sync_controlled_properties(static_cast<GstClockTime>(part_end));
    const EventBuckets* events = simulator.hold_until(part_end, begin_interval().simulation);
    stream_.handed_out_until = part_end;
    if (events != nullptr && events->size() > 0) {
      if (sent < start) flow = push_gap(sent, start, seqnum);
      const OwnedBuffer in(gst_buffer_new());
      OwnedBuffer out;
      if (flow == GST_FLOW_OK) flow = write_events(*events, in.get(), start, part_end, out);
      if (flow == GST_FLOW_OK)
        flow = push_buffer(std::move(out), static_cast<GstClockTime>(start),
                           static_cast<GstClockTime>(part_end - start));
      sent = part_end;
    }
    start = part_end;
  }
  if (sent < end && flow == GST_FLOW_OK) flow = push_gap(sent, end, seqnum);
}

/* intervals out */

void StreamSimulation::finish() {
  if (state_) reported([&] { state_->frames->finish(); });
}

void StreamSimulation::push_finished() {
  if (state_) reported([&] { state_->frames->push_finished(); });
}

void StreamSimulation::push_interval(Interval interval, const EventBuckets* events) {
  auto& [frame, start, end, began] = interval;
  if (events == nullptr) {
    timing.end_work(end, began);
    timing.end();
    return;
  }
  GST_LOG_OBJECT(element_,
                 "%" G_GSIZE_FORMAT " events in the interval from %" GST_TIME_FORMAT
                 " to %" GST_TIME_FORMAT,
                 events->size(), GST_TIME_ARGS(static_cast<GstClockTime>(start)),
                 GST_TIME_ARGS(static_cast<GstClockTime>(end)));

  auto& flow = stream_.flow;
  OwnedBuffer out;
  if (events->size() > 0) flow = write_events(*events, frame.get(), start, end, out);
  frame.reset();  // upstream may need it while downstream blocks
  timing.end_work(end, began);
  timing.add_interval(start, end);
  if (events->size() == 0)
    flow = push_gap(start, end, GST_SEQNUM_INVALID);
  else if (flow == GST_FLOW_OK)
    flow = push_buffer(std::move(out), static_cast<GstClockTime>(start),
                       static_cast<GstClockTime>(end - start));
  timing.end();
}

/// Writes the events of an interval, and their labels, to a new buffer. `frame` ends it. May throw.
GstFlowReturn StreamSimulation::write_events(const EventBuckets& events, GstBuffer* frame,
                                             Nanoseconds start, Nanoseconds end, OwnedBuffer& out) {
  auto& simulator = state_->simulator();
  const GstFlowReturn result =
      event_simulator_write_events(element_, events, simulator, frame, out);
  if (result != GST_FLOW_OK || !simulator.has_labels()) return result;
  GST_BUFFER_PTS(out.get()) = static_cast<GstClockTime>(start);  // without it, none can be mapped
  return class_images.set_classes(out.get(), element_->segment, state_->video, start, end);
}

/// Pushes a GAP for an interval without events.
GstFlowReturn StreamSimulation::push_gap(Nanoseconds start, Nanoseconds end, guint32 seqnum) {
  GstEvent* gap =
      gst_event_new_gap(static_cast<GstClockTime>(start), static_cast<GstClockTime>(end - start));
  if (seqnum != GST_SEQNUM_INVALID) gst_event_set_seqnum(gap, seqnum);
  return push_event(GST_BASE_TRANSFORM_SRC_PAD(element_), gap);
}

/// Sets the timestamps and flags of an output buffer, and pushes it.
GstFlowReturn StreamSimulation::push_buffer(OwnedBuffer out, GstClockTime pts,
                                            GstClockTime duration) {
  GST_BUFFER_PTS(out.get()) = pts;
  GST_BUFFER_DTS(out.get()) = GST_CLOCK_TIME_NONE;
  GST_BUFFER_DURATION(out.get()) = duration;
  if (std::exchange(stream_.discontinuous, false))
    GST_BUFFER_FLAG_SET(out.get(), GST_BUFFER_FLAG_DISCONT);
  if (element_->segment.format == GST_FORMAT_TIME)
    element_->segment.position = GST_CLOCK_TIME_IS_VALID(duration) ? pts + duration : pts;
  return gst_pad_push(GST_BASE_TRANSFORM_SRC_PAD(element_), out.release());
}

/* the end */

void StreamSimulation::end() {
  for (auto* companion : companions()) companion->end();
  if (!state_) return;
  warn_of_no_progress();
  reported([&] { restore_at_start(); });  // a clip without frames passes the state on
  if (!state_) return;
  const auto save = method().save;
  auto& simulator = state_->simulator();
  if (save != nullptr && simulator.last_time())
    reported([&] { save(simulator, G_OBJECT(element_)); });
}

/// Warns if a stream that continues from a state ended before it.
void StreamSimulation::warn_of_no_progress() {
  const auto from = stream_.continuation.time();
  if (!from || state_->simulator().last_time() != from) return;
  stream_.warn_of_times(element_,
                        {GST_STREAM_ERROR_FORMAT,
                         "No events: all frames are before the state that initial-state names. "
                         "Give them the timestamps that they have in the whole video."},
                        "the state is that at " + std::to_string(*from) + " ns");
}

void StreamSimulation::reset() {
  state_.reset();
  stream_ = {};
  flow_tensors.reset();
}
