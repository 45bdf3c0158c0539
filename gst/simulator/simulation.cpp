// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/simulation.hpp"

#include <cmath>

#include "gst/base/buffer_bytes.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/event_pool.hpp"
#include "gst/base/pads.hpp"
#include "gst/simulator/frame_luma.hpp"

#define GST_CAT_DEFAULT event_simulator_debug

using eventcamera::Event;
using eventcamera::EventBuckets;
using eventcamera::Flow;
using eventcamera::Image;
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
void Simulation::reported(const Work& work) {
  const auto failure = [this](const std::exception& error) {
    state_.reset();
    stream_.discontinuous = true;
    return report_of(error, "Not enough memory for the events of a frame. Raise the thresholds.",
                     "The simulation failed.");
  };
  if (!catch_exceptions(element_, failure, work)) stream_.flow = GST_FLOW_ERROR;
}

/* negotiation */

bool Simulation::set_caps(GstCaps* in, GstCaps* out) {
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
    const bool draws = event_simulator_draws(out);
    if (draws || (state_ && FrameLuma::format_of(state_->video) != luma)) push_late_events();
    if (!state_ || FrameLuma::format_of(state_->video) != luma) {
      if (state_ && state_->simulator().last_time()) stream_.discontinuous = true;
      state_.reset();  // before allocating the next: frames can be large
      stream_.motion.reset();
      state_.emplace(State{.video = video, .frames = method().create(G_OBJECT(element_), video)});
    } else {
      state_->video = video;
      state_->frames->set_video(video);
    }
    stream_.repeated.reset();  // the last frame may have another format
    stream_.picture.reset();
    state_->draws = draws;
    if (draws) state_->frames->set_drawn_video(drawn);
  });
  if (!made) return false;
  GST_DEBUG_OBJECT(element_, "%s of %" GST_PTR_FORMAT, state_->draws ? "event frames" : "events",
                   in);
  const GstClockTime before = latency();
  draws_ = state_->draws;
  stream_.interval.expect(static_cast<Nanoseconds>(frame_duration(video)));
  update_latency(before);
  if (!state_->draws) check_sink();
  return true;
}

/// Warns about a sink that writes events to a file without the times of their buffers.
void Simulation::check_sink() {
  const OwnedPad peer(gst_pad_get_peer(GST_BASE_TRANSFORM_SRC_PAD(element_)));
  const OwnedElement sink(peer ? gst_pad_get_parent_element(peer.get()) : nullptr);
  const gchar* const klass =
      sink ? gst_element_get_metadata(sink.get(), GST_ELEMENT_METADATA_KLASS) : nullptr;
  if (klass == nullptr || !g_str_equal(klass, "Sink/File")) return;
  stream_.warn_of_bare_file(
      element_,
      {GST_STREAM_ERROR_FORMAT,
       "A file of these buffers cannot be read: event times count from the start of a buffer, "
       "which is not in it. Insert a writer of event files, such as eventnpzenc, before the file."},
      std::string("linked to ") + GST_OBJECT_NAME(sink.get()));
}

/// Ensures that there is a state. Errors drop it while the pads keep their caps; if the application
/// continues, it is recreated from these. False if that fails.
bool Simulation::ensure_state() {
  if (state_) return true;
  const OwnedCaps in(gst_pad_get_current_caps(GST_BASE_TRANSFORM_SINK_PAD(element_)));
  const OwnedCaps out(gst_pad_get_current_caps(GST_BASE_TRANSFORM_SRC_PAD(element_)));
  return in && out && set_caps(in.get(), out.get());
}

/* latency */

void IntervalDuration::expect(Nanoseconds duration) {
  if (duration == expected_) return;
  last_.clear();
  expected_ = duration;
  value_ = duration;
}

void IntervalDuration::add(Nanoseconds duration) {
  last_.push_back(std::min(duration, max));
  if (last_.size() > max_count) last_.pop_front();
  std::vector<Nanoseconds> sorted(last_.begin(), last_.end());
  std::ranges::sort(sorted, std::greater());
  const bool is_only_one = expected_ == 0 && sorted.size() == 1;
  const Nanoseconds second = is_only_one ? sorted[0] : sorted.size() > 1 ? sorted[1] : 0;
  if (second > value_ + value_ / 8)
    value_ = second;
  else if (sorted[0] < value_ / 4 * 3)
    value_ = std::max(sorted[0], expected_);
}

/// Adopts the duration of intervals, and posts a message if that changes the latency.
void Simulation::update_latency(GstClockTime before) {
  interval_ = static_cast<GstClockTime>(stream_.interval.value());
  if (latency() == before) return;
  GST_DEBUG_OBJECT(element_, "latency is now %" GST_TIME_FORMAT, GST_TIME_ARGS(latency()));
  post_latency(element_);
}

bool Simulation::is_live() {
  if (!stream_.is_live) {
    GstQuery* query = gst_query_new_latency();
    gboolean live = FALSE;
    if (gst_pad_peer_query(GST_BASE_TRANSFORM_SINK_PAD(element_), query))
      gst_query_parse_latency(query, &live, nullptr, nullptr);
    gst_query_unref(query);
    stream_.is_live = live != FALSE;
  }
  return *stream_.is_live;
}

/// Runs `work` on a frame, and adds the time that it takes by the clock to the counters.
template <class Work>
auto Simulation::timed(const Work& work) {
  const GstClockTime began = gst_element_get_current_running_time(GST_ELEMENT(element_));
  auto result = work();
  const GstClockTime ended = gst_element_get_current_running_time(GST_ELEMENT(element_));
  const auto counted = stats.lock();
  ++counted->frames;
  if (GST_CLOCK_TIME_IS_VALID(began) && GST_CLOCK_TIME_IS_VALID(ended) && ended > began)
    counted->processing_time += ended - began;
  return result;
}

/* times of frames */

/// Position in the segment of the running time now, if the source is live.
std::optional<GstClockTime> Simulation::time_of_arrival() {
  if (!is_live()) return std::nullopt;
  const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(element_));
  const guint64 position =
      gst_segment_position_from_running_time(&element_->segment, GST_FORMAT_TIME, now);
  if (!GST_CLOCK_TIME_IS_VALID(now) || !GST_CLOCK_TIME_IS_VALID(position)) return std::nullopt;
  return position;
}

/// Returns the frame with a PTS. One without gets the time of its arrival if the source is live,
/// else one according to the framerate of the caps. Null if neither is known.
OwnedBuffer Simulation::with_time(OwnedBuffer frame) {
  const GstClockTime duration = frame_duration(state_->video);
  GstClockTime time = GST_BUFFER_PTS(frame.get());
  if (!GST_CLOCK_TIME_IS_VALID(time)) {
    const char* text =
        "The video has neither timestamps nor a framerate, so there are no events. Set the PTS of "
        "its buffers, or a framerate in its caps.";
    if (const auto arrival = time_of_arrival()) {
      time = *arrival;
      text =
          "The video has no timestamps: using the arrival times of its frames. Set "
          "do-timestamp=true on the source, or the PTS of its buffers.";
    } else if (duration > 0) {
      time = stream_.next_time.value_or(element_->segment.start);
      text =
          "The video has no timestamps: using its framerate. Set the PTS of its buffers if frames "
          "are not evenly spaced.";
    }
    stream_.warn_of_no_pts(element_, {GST_STREAM_ERROR_FORMAT, text},
                           "a buffer has no PTS; the framerate in the caps is " +
                               std::to_string(GST_VIDEO_INFO_FPS_N(&state_->video)) + "/" +
                               std::to_string(GST_VIDEO_INFO_FPS_D(&state_->video)));
    if (!GST_CLOCK_TIME_IS_VALID(time)) return nullptr;
    frame.reset(gst_buffer_make_writable(frame.release()));
    GST_BUFFER_PTS(frame.get()) = time;
  }
  stream_.next_time = time + duration;
  return frame;
}

void Simulation::warn_of_times(const char* what) {
  stream_.warn_of_times(
      element_,
      {GST_STREAM_ERROR_FORMAT, std::string("Bad video timestamps: ") + what +
                                    ". No events are simulated across this point; videorate or a "
                                    "parser upstream can repair timestamps."},
      "an interval needs a PTS at both ends");
}

/// Returns the time of a frame: its PTS. Decoders give a frame the PTS of the one before if the
/// timestamps of a file are not in the order of its frames, or are missing, as in GIF. Then it
/// follows after the duration of the last frame; in the middle of a stream, the first one after
/// half of that, because the next frame often has the right time.
Nanoseconds Simulation::time_of(GstBuffer* frame) {
  const GstClockTime pts = GST_BUFFER_PTS(frame);
  const auto time = static_cast<Nanoseconds>(pts);
  const auto before = std::exchange(stream_.last_pts, pts);
  GstClockTime duration = std::exchange(stream_.last_duration, GST_BUFFER_DURATION(frame));
  if (duration == 0 || duration > GST_SECOND) duration = interval_;
  const auto last = state_->simulator().last_time();
  const bool is_late_enough = last && time - *last >= Nanoseconds{event_resolution};
  if (!before || pts < *before || !last || is_late_enough || duration == 0) return time;
  stream_.warn_of_equal_times(
      element_,
      {GST_STREAM_ERROR_FORMAT,
       "Bad video timestamps: frames have the same one. Spacing them by their durations."},
      "a frame is not later than the one before");
  const bool is_one_of_many = *last > time || !stream_.pushed_until;
  return *last + static_cast<Nanoseconds>(is_one_of_many ? duration : duration / 2);
}

/// Returns why the interval since the last frame cannot end at `time`; null if it can.
const char* Simulation::fault_of_time(Nanoseconds time) const {
  const auto last = state_->simulator().last_time();
  if (!last) return nullptr;
  if (time <= *last) return "a frame is not later than the previous one";
  if (time - *last < Nanoseconds{event_resolution})
    return "two frames are less than a microsecond apart";
  if (time - *last > eventcamera::max_interval) return "two frames are more than 71 minutes apart";
  return nullptr;
}

/// Warns about interlaced video, whose two fields are captured at different times.
void Simulation::check_interlacing(GstBuffer* frame) {
  const auto mode = GST_VIDEO_INFO_INTERLACE_MODE(&state_->video);
  if (mode == GST_VIDEO_INTERLACE_MODE_PROGRESSIVE ||
      (mode == GST_VIDEO_INTERLACE_MODE_MIXED &&
       !GST_BUFFER_FLAG_IS_SET(frame, GST_VIDEO_BUFFER_FLAG_INTERLACED)))
    return;
  stream_.warn_of_interlacing(
      element_,
      {GST_STREAM_ERROR_FORMAT,
       "The video is interlaced: moving edges will fire in every other row. Insert a deinterlace "
       "element upstream."},
      std::string("interlace-mode=") + gst_video_interlace_mode_to_string(mode));
}

/// Pad that sends to `sink`, within bins; null if there is none.
static OwnedPad source_of(GstPad* sink) {
  OwnedPad peer(gst_pad_get_peer(sink));
  while (peer && GST_IS_PROXY_PAD(peer.get())) {
    GstPad* const inner = GST_IS_GHOST_PAD(peer.get())
                              ? gst_ghost_pad_get_target(GST_GHOST_PAD(peer.get()))
                              : GST_PAD(gst_proxy_pad_get_internal(GST_PROXY_PAD(peer.get())));
    const bool is_source = GST_IS_GHOST_PAD(peer.get());
    peer.reset(inner);
    if (peer && !is_source) peer.reset(gst_pad_get_peer(inner));
  }
  return peer;
}

/// True if an element upstream turns or flips the video. videoflip 1.22 leaves the tags unchanged.
static bool is_turned_before(GstPad* sink) {
  constexpr int max_elements = 64;
  OwnedPad source = source_of(sink);
  for (int i = 0; i < max_elements && source; ++i) {
    const OwnedElement element(gst_pad_get_parent_element(source.get()));
    if (!element) return false;
    if (GST_IS_VIDEO_DIRECTION(element.get())) {
      gint direction = GST_VIDEO_ORIENTATION_IDENTITY;
      g_object_get(element.get(), "video-direction", &direction, nullptr);
      if (direction != GST_VIDEO_ORIENTATION_IDENTITY) return true;
    }
    const OwnedPad next(gst_element_get_static_pad(element.get(), "sink"));
    source = next ? source_of(next.get()) : nullptr;
  }
  return false;
}

void Simulation::check_orientation(GstEvent* tags) {
  GstTagList* list = nullptr;
  gst_event_parse_tag(tags, &list);
  const gchar* orientation = nullptr;
  if (!gst_tag_list_peek_string_index(list, GST_TAG_IMAGE_ORIENTATION, 0, &orientation) ||
      g_str_equal(orientation, "rotate-0") ||
      is_turned_before(GST_BASE_TRANSFORM_SINK_PAD(element_)))
    return;
  stream_.warn_of_orientation(
      element_,
      {GST_STREAM_ERROR_FORMAT,
       "The video is rotated, and so are its events. Insert videoflip video-direction=auto "
       "upstream."},
      std::string("image-orientation=") + orientation);
}

/* discontinuities */

/// Makes the next frame, at `next` if that is known, a first frame.
void Simulation::forget_frames(GstClockTime next) {
  stream_.gap.reset();
  stream_.motion.reset();
  stream_.repeated.reset();
  if (!state_) return;
  push_interval(state_->frames->finish());
  push_late_events(next);
  if (!state_->simulator().last_time()) return;
  GST_DEBUG_OBJECT(element_, "the next frame begins an interval; the last was at %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(static_cast<GstClockTime>(*state_->simulator().last_time())));
  state_->simulator().reset();
  stream_.discontinuous = true;
}

/// Restarts at a first frame, for a new timeline.
void Simulation::start_over(GstClockTime next) {
  forget_frames(next);
  stream_.pushed_until.reset();
}

void Simulation::start_timeline() {
  if (state_) {
    state_->frames->drop();
    if (state_->simulator().last_time()) stream_.discontinuous = true;
    state_->simulator().reset();
  }
  stream_.flow = GST_FLOW_OK;
  reported([&] { start_over(); });
  stream_.next_time.reset();
  stream_.last_pts.reset();
}

void Simulation::interrupt(GstClockTime pts) {
  reported([&] { start_over(pts); });
  stream_.last_pts.reset();
  stream_.discontinuous = true;
}

void Simulation::skip_frame(GstClockTime pts) {
  GST_DEBUG_OBJECT(element_, "downstream is late: skipped the frame at %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(pts));
  stream_.motion.reset();    // it ends at the frame that was skipped
  stream_.repeated.reset();  // the next frame may repeat it
  ++stats.lock()->skipped_frames;
}

/* settings */

void Simulation::sync_controlled_properties(GstClockTime time) {
  const GstSegment& segment = element_->segment;
  if (segment.format != GST_FORMAT_TIME) return;  // before the first segment
  const auto stream_time = gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, time);
  if (GST_CLOCK_TIME_IS_VALID(stream_time))
    gst_object_sync_values(GST_OBJECT(element_), stream_time);
}

/// Configures the simulator for the next interval, and returns its settings.
SimulatorSettings Simulation::begin_interval() {
  if (const auto configure = method().configure) configure(state_->simulator(), G_OBJECT(element_));
  SimulatorSettings current = settings.copy();
  if (state_->draws) {
    current.simulation.labels = false;
    current.simulation.rolling_shutter = 0;  // a picture has the rows of its frame
  }
  return current;
}

/* optical flow */

static Flow limited(const Flow& motion) {
  const auto limit = [](float length) {
    constexpr float max_length = eventcamera::max_side;
    return std::isfinite(length) ? std::clamp(length, -max_length, max_length) : 0;
  };
  return {limit(motion.x), limit(motion.y)};
}

/// Returns the motion since the last frame if its meta states it and the simulator needs it.
KnownFlow Simulation::known_flow() {
  auto& simulator = state_->simulator();
  const auto motion = std::move(stream_.motion);
  if (!motion || !simulator.last_time() || !simulator.needs_flow()) return std::nullopt;
  const int width = GST_VIDEO_INFO_WIDTH(&state_->video);
  const int height = GST_VIDEO_INFO_HEIGHT(&state_->video);
  Image<Flow>& flow = state_->flow;
  if (flow.width() != width || flow.height() != height) flow = Image<Flow>(width, height);
  const auto* row = static_cast<const Flow*>(g_bytes_get_data(motion.get(), nullptr));
  for (int y = 0; y < height; ++y, row += width)
    std::transform(row, row + width, flow.row(y), limited);
  return flow.view();
}

/// Stores the motion to the next frame from the meta of a frame. Throws VideoSimulatorError unless
/// it has the size of the video.
void Simulation::keep_flow(GstBuffer* frame) {
  const auto* meta = gst_buffer_get_event_camera_flow_meta(frame);
  if (meta == nullptr) return;
  const int width = GST_VIDEO_INFO_WIDTH(&state_->video);
  const int height = GST_VIDEO_INFO_HEIGHT(&state_->video);
  if (meta->width != static_cast<guint>(width) || meta->height != static_cast<guint>(height))
    throw VideoSimulatorError(
        {GST_STREAM_ERROR_FORMAT,
         "The optical flow of a frame has " + std::to_string(meta->width) + "x" +
             std::to_string(meta->height) + " pixels, and the video has " + std::to_string(width) +
             "x" + std::to_string(height) + ". Add the flow after the video is scaled or cropped."},
        "size in GstEventCameraFlowMeta");
  stream_.motion.reset(g_bytes_ref(gst_event_camera_flow_meta_get_flow(meta)));
}

static void add_flow(GstBuffer* buffer, const eventcamera::ImageView<Flow>& flow) {
  const auto width = static_cast<std::size_t>(flow.width);
  std::vector<Flow> rows(width * static_cast<std::size_t>(flow.height));
  for (int y = 0; y < flow.height; ++y)
    std::copy_n(flow.row(y), width, rows.data() + static_cast<std::size_t>(y) * width);
  GBytes* bytes = g_bytes_new(rows.data(), rows.size() * sizeof(Flow));
  gst_buffer_add_event_camera_flow_meta(buffer, static_cast<guint>(flow.width),
                                        static_cast<guint>(flow.height), bytes);
  g_bytes_unref(bytes);
}

/* frames in */

GstFlowReturn Simulation::push_frame(OwnedBuffer frame) {
  auto& flow = stream_.flow;
  // Since output was pushed outside of this function, downstream may have been relinked.
  if (flow != GST_FLOW_EOS && flow != GST_FLOW_ERROR) {
    flow = GST_FLOW_OK;
    if (!ensure_state()) return GST_FLOW_NOT_NEGOTIATED;
    if (OwnedBuffer timed_frame = with_time(std::move(frame)))
      reported([&] { simulate(std::move(timed_frame)); });
  }
  return std::exchange(flow, GST_FLOW_OK);
}

/// Simulates the interval that a frame with a PTS ends, if any.
void Simulation::simulate(OwnedBuffer frame) {
  const GstClockTime pts = GST_BUFFER_PTS(frame.get());
  check_interlacing(frame.get());
  if (pts > G_MAXINT64) {
    warn_of_times("the PTS of a frame is out of range");
    forget_frames();
    return;
  }
  const Nanoseconds time = time_of(frame.get());
  const bool compare = settings.copy().skip_repeated;
  const auto kind = stream_.repeated.kind_of(frame.get(), time, compare, state_->video);
  if (kind == RepeatedFrames::Kind::repeated) {
    stream_.repeated.add(frame.get(), time, compare, kind);
    return repeat(frame.get(), time);
  }
  hold_last_frame(static_cast<GstClockTime>(time));
  sync_controlled_properties(static_cast<GstClockTime>(time));
  if (const char* fault = fault_of_time(time)) {
    warn_of_times(fault);
    forget_frames();
  }
  // An interval starting with this frame would overlap the last one.
  if (const auto until = stream_.pushed_until; until && time < *until) {
    GST_LOG_OBJECT(element_,
                   "skipping the frame at %" GST_TIME_FORMAT ": events until %" GST_TIME_FORMAT
                   " were sent",
                   GST_TIME_ARGS(pts), GST_TIME_ARGS(static_cast<GstClockTime>(*until)));
    return;
  }
  stream_.repeated.add(frame.get(), time, compare, kind);
  auto& frames = *state_->frames;
  const auto start = state_->simulator().last_time();
  const SimulatorSettings current = begin_interval();
  const KnownFlow flow = known_flow();
  keep_flow(frame.get());
  if (start || state_->draws) stream_.pushed_until = time;
  if (start) {
    const GstClockTime before = latency();
    stream_.interval.add(time - *start);
    update_latency(before);
  }
  if (state_->draws) return draw_frame(current, flow, std::move(frame));
  push_interval(timed([&] {
    return frames.push({std::move(frame), start.value_or(time), time}, current.simulation, flow);
  }));
  // Where no other frame may follow soon, do not wait for it.
  if (is_live()) push_interval(frames.finish());
}

/// Draws the events since the last frame (none for a first frame). The picture replaces the frame.
void Simulation::draw_frame(const SimulatorSettings& current, const KnownFlow& flow,
                            OwnedBuffer frame) {
  const GstClockTime pts = GST_BUFFER_PTS(frame.get());
  const GstClockTime duration = GST_BUFFER_DURATION(frame.get());
  OwnedBuffer picture;
  stream_.flow = timed([&] {
    GstBuffer* prepared = nullptr;
    const GstFlowReturn result = event_simulator_prepare_buffer(element_, frame.get(), &prepared);
    if (result != GST_FLOW_OK) return result;
    picture.reset(prepared);
    keep_metas(frame.get(), prepared);
    state_->frames->draw(std::move(frame), static_cast<Nanoseconds>(pts), current.simulation, flow,
                         eventcamera::palette(current.palette), prepared);
    return GST_FLOW_OK;
  });
  if (!picture) return;
  stream_.picture.reset(gst_buffer_ref(picture.get()));
  stream_.flow = push_buffer(std::move(picture), pts, duration);
}

/// Continues the interval in a frame that repeats the last one, or draws the last picture again.
void Simulation::repeat(GstBuffer* frame, Nanoseconds time) {
  ++stats.lock()->repeated_frames;
  keep_flow(frame);
  if (!stream_.picture) return;
  stream_.pushed_until = time;
  OwnedBuffer again(gst_buffer_copy(stream_.picture.get()));
  GST_BUFFER_FLAG_UNSET(again.get(), GST_BUFFER_FLAG_DISCONT);
  stream_.flow = push_buffer(std::move(again), GST_BUFFER_PTS(frame), GST_BUFFER_DURATION(frame));
}

/* gaps */

bool Simulation::hold_through(GstEvent* gap) {
  if (!state_ || state_->draws || !state_->simulator().last_time()) return false;
  GstClockTime start = GST_CLOCK_TIME_NONE;
  GstClockTime duration = GST_CLOCK_TIME_NONE;
  gst_event_parse_gap(gap, &start, &duration);
  if (!GST_CLOCK_TIME_IS_VALID(duration) || start > G_MAXINT64 || duration > G_MAXINT64 - start)
    return true;
  if (stream_.gap) start = std::min(start, stream_.gap->start);
  stream_.gap = {start, start + duration, gst_event_get_seqnum(gap)};
  return true;
}

/// Holds the last frame through a gap that ends no later than the next frame, until one frame
/// duration before its end, where the interval of the next frame begins.
void Simulation::hold_last_frame(GstClockTime next) {
  if (!stream_.gap || next <= stream_.gap->start) return;  // the frame was overtaken by the gap
  const Gap gap = *std::exchange(stream_.gap, std::nullopt);
  const GstClockTime frame = interval_;
  if (next < gap.end || frame == 0 || gap.end - gap.start <= frame) return;
  const auto end = static_cast<Nanoseconds>(gap.end - frame);
  push_interval(state_->frames->finish());
  const auto last = state_->simulator().last_time();
  if (last && *last < end) hold_until(end, gap.seqnum);
}

/// Holds the last frame until `end`, and pushes the events of that time, and GAPs where there are
/// none, in parts, because a pixel has a maximum number of events in each. Noise ends after a
/// minute: hours of it would fill the disk.
void Simulation::hold_until(Nanoseconds end, guint32 seqnum) {
  constexpr auto max_part = Nanoseconds{250 * GST_MSECOND};
  constexpr auto max_noise = Nanoseconds{60 * GST_SECOND};
  auto& simulator = state_->simulator();
  auto& flow = stream_.flow;
  stream_.motion.reset();  // the interval of the next frame is shorter
  Nanoseconds sent = *simulator.last_time();
  const Nanoseconds noise_end = std::min(end, sent + max_noise);
  bool has_noise = false;
  for (Nanoseconds start = sent; start < noise_end && flow == GST_FLOW_OK;) {
    if (GST_PAD_IS_FLUSHING(GST_BASE_TRANSFORM_SRC_PAD(element_))) flow = GST_FLOW_FLUSHING;
    const Nanoseconds part_end = std::min(start + max_part, noise_end);
    sync_controlled_properties(static_cast<GstClockTime>(part_end));
    const EventBuckets* events = state_->frames->hold_until(part_end, begin_interval().simulation);
    stream_.pushed_until = part_end;
    has_noise |= events != nullptr && events->size() > 0;
    if (events != nullptr && events->size() > 0) {
      if (sent < start) flow = push_gap(sent, start, seqnum);
      if (flow == GST_FLOW_OK)
        push_interval(Interval{OwnedBuffer(gst_buffer_new()), start, part_end, events});
      sent = part_end;
    }
    start = part_end;
  }
  if (noise_end < end && has_noise)
    stream_.warn_of_long_gap(
        element_,
        {GST_STREAM_ERROR_FORMAT,
         "The video pauses for more than a minute: the rest of such a pause has no noise."},
        "a gap of " + std::to_string((end - noise_end + max_noise) / Nanoseconds{GST_SECOND}) +
            " s");
  simulator.skip_until(end);
  stream_.pushed_until = end;
  if (sent < end && flow == GST_FLOW_OK) flow = push_gap(sent, end, seqnum);
}

/* intervals out */

void Simulation::finish() {
  if (state_) reported([&] { push_interval(state_->frames->finish()); });
}

void Simulation::end() {
  if (!state_) return;
  reported([&] {
    hold_last_frame(GST_CLOCK_TIME_NONE);
    const auto last = state_->simulator().last_time();
    const auto repeated = stream_.repeated.last_time();
    if (!state_->draws && last && repeated && *last < *repeated)
      hold_until(*repeated, GST_SEQNUM_INVALID);
    push_late_events();
  });
}

/// Releases the frame of a finished interval, and pushes the events: a GAP if there are none.
void Simulation::push_interval(std::optional<Interval> interval) {
  if (!interval) return;
  auto& [frame, start, end, events] = *interval;
  GST_LOG_OBJECT(element_,
                 "%" G_GSIZE_FORMAT " events in the interval from %" GST_TIME_FORMAT
                 " to %" GST_TIME_FORMAT,
                 events->size(), GST_TIME_ARGS(static_cast<GstClockTime>(start)),
                 GST_TIME_ARGS(static_cast<GstClockTime>(end)));
  auto& flow = stream_.flow;
  if (events->size() == 0) {
    flow = push_gap(start, end, GST_SEQNUM_INVALID);
    return;
  }
  OwnedBuffer out;
  flow = write_events(*events, frame.get(), out);
  frame.reset();  // upstream may need it while downstream blocks
  if (flow == GST_FLOW_OK)
    flow = push_buffer(std::move(out), static_cast<GstClockTime>(start),
                       static_cast<GstClockTime>(end - start));
}

/// Pushes the events of rows that a rolling shutter read after the last frame's timestamp, in an
/// interval that ends at the `next` frame at the latest; later events are dropped.
void Simulation::push_late_events(GstClockTime next) {
  if (!state_) return;
  auto& simulator = state_->simulator();
  const auto start = simulator.last_time();
  auto end = simulator.late_until();
  if (!start || !end) return;
  const bool is_soon =
      next > static_cast<GstClockTime>(*start) && next < static_cast<GstClockTime>(*end);
  if (is_soon) end = static_cast<Nanoseconds>(next);
  stream_.pushed_until = *end;
  push_interval(Interval{OwnedBuffer(gst_buffer_new()), *start, *end, simulator.late_events(*end)});
}

/// Writes the events of an interval, at least one, with their labels and their flow to a new
/// buffer. `frame` ends the interval.
GstFlowReturn Simulation::write_events(const EventBuckets& events, GstBuffer* frame,
                                       OwnedBuffer& out) {
  GstBuffer* prepared = nullptr;
  const GstFlowReturn result = event_simulator_prepare_buffer(element_, frame, &prepared);
  if (result != GST_FLOW_OK) return result;
  out.reset(prepared);
  auto& simulator = state_->simulator();
  event_pool_reserve(prepared, events.size() * sizeof(Event));
  {
    const WritableBytes map(prepared);
    const std::span<Event> written = map.events();
    events.write_to(written.data(), simulator.threads());
    if (simulator.has_labels()) simulator.label({written, add_labels(prepared, written.size())});
  }
  if (simulator.flow() && settings.copy().write_flow) add_flow(prepared, *simulator.flow());
  return GST_FLOW_OK;
}

GstFlowReturn Simulation::push_gap(Nanoseconds start, Nanoseconds end, guint32 seqnum) {
  GstEvent* gap =
      gst_event_new_gap(static_cast<GstClockTime>(start), static_cast<GstClockTime>(end - start));
  if (seqnum != GST_SEQNUM_INVALID) gst_event_set_seqnum(gap, seqnum);
  return push_event(GST_BASE_TRANSFORM_SRC_PAD(element_), gap);
}

GstFlowReturn Simulation::push_buffer(OwnedBuffer out, GstClockTime pts, GstClockTime duration) {
  GST_BUFFER_PTS(out.get()) = pts;
  GST_BUFFER_DTS(out.get()) = GST_CLOCK_TIME_NONE;
  GST_BUFFER_DURATION(out.get()) = duration;
  if (std::exchange(stream_.discontinuous, false))
    GST_BUFFER_FLAG_SET(out.get(), GST_BUFFER_FLAG_DISCONT);
  if (element_->segment.format == GST_FORMAT_TIME)
    element_->segment.position = GST_CLOCK_TIME_IS_VALID(duration) ? pts + duration : pts;
  return gst_pad_push(GST_BASE_TRANSFORM_SRC_PAD(element_), out.release());
}

void Simulation::reset() {
  state_.reset();
  stream_ = {};
  interval_ = 0;
}
