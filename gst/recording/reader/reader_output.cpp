// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/reader/reader_output.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "gst/recording/frame_buffer.hpp"
#include "gst/recording/reader/event_reader.hpp"
#include "gst/recording/sensor_events.hpp"

GST_DEBUG_CATEGORY_EXTERN(event_reader_debug);
#define GST_CAT_DEFAULT event_reader_debug

using eventcamera::Microseconds;
using eventcamera::RecordingReader;
using eventcamera::StreamKind;

ReaderOutput::ReaderOutput(GstElement* element, GstPad* sink, const EventReaderFormat& format,
                           Guarded<FormatSettings>& settings, ReaderTimeline& timeline)
    : element_(element),
      sink_(sink),
      format_(format),
      settings_(settings),
      timeline_(timeline),
      warn_of_assumption_(event_reader_debug) {}

ReaderOutput::~ReaderOutput() {
  drop_waiting();
  gst_clear_event(&stream_start_);
  gst_flow_combiner_free(combiner_);
}

void ReaderOutput::drop_waiting() {
  for (GstEvent* event : std::exchange(waiting_, {})) gst_event_unref(event);
}

void ReaderOutput::reset() {
  drop_waiting();
  gst_clear_event(&stream_start_);
  set_recording(nullptr);
  warn_of_assumption_.reset();
  for (auto& pad : pads_) {
    pad->reset();
    if (!format_.has_many_streams) continue;
    gst_flow_combiner_remove_pad(combiner_, pad->get());
    if (pad->is_added()) gst_element_remove_pad(element_, pad->get());
  }
  if (format_.has_many_streams) {
    pads_.clear();
    has_no_more_pads_ = false;
  }
  gst_flow_combiner_reset(combiner_);
  group_ = GST_GROUP_ID_INVALID;
  seqnum_ = GST_SEQNUM_INVALID;
}

void ReaderOutput::set_recording(std::shared_ptr<RecordingReader> recording) {
  recording_ = std::move(recording);
  pad_of_stream_.clear();
  is_due_ = true;
}

void ReaderOutput::start_stream(GstEvent* stream_start) {
  gst_event_replace(&stream_start_, stream_start);
  for (auto& pad : pads_) pad->reset();
  group_ = GST_GROUP_ID_INVALID;
  is_due_ = true;
}

void ReaderOutput::interrupt() {
  for (auto& pad : pads_) pad->interrupt();
  is_due_ = true;
}

void ReaderOutput::interrupt_data() {
  for (auto& pad : pads_) pad->interrupt_data();
}

void ReaderOutput::flush() {
  drop_waiting();
  gst_flow_combiner_reset(combiner_);
  interrupt();
}

void ReaderOutput::expect_segment() {
  for (auto& pad : pads_) pad->need_segment(false);
}

/// New streams are known.
GstFlowReturn ReaderOutput::push(const RecordingReader::Start& /*start*/) {
  is_due_ = true;
  return begin();
}

GstFlowReturn ReaderOutput::push(const RecordingReader::Chunk& chunk) {
  if (const GstFlowReturn begun = begin(); begun != GST_FLOW_OK) return begun;
  auto& pad = *pad_of_stream_.at(chunk.stream);
  if (!send_caps(chunk.stream)) return handle_refused_size(chunk.stream);
  const GstClockTime pts = nanoseconds(recording_->origin()) + nanoseconds(chunk.start);
  const GstClockTime duration = nanoseconds(chunk.duration);
  GST_LOG_OBJECT(pad.get(),
                 "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT " for %" GST_TIME_FORMAT,
                 chunk.events.size(), GST_TIME_ARGS(pts), GST_TIME_ARGS(duration));
  if (chunk.events.empty()) return combined(pad, pad.push_gap(pts, duration));
  auto memory = pad.spare_memory();
  recording_->swap_memory(chunk.stream, memory);
  const auto count = chunk.events.size();
  return combined(pad, pad.push(std::move(memory), count, chunk.labels, pts, duration));
}

GstFlowReturn ReaderOutput::push(const RecordingReader::TimedFrame& item) {
  if (const GstFlowReturn begun = begin(); begun != GST_FLOW_OK) return begun;
  auto& pad = *pad_of_stream_.at(item.stream);
  GstVideoInfo info;
  if (!frame_video_info(item.frame, &info)) return GST_FLOW_OK;
  if (!pad.send_caps(info) && GST_PAD_IS_FLUSHING(pad.get())) return GST_FLOW_FLUSHING;
  const GstClockTime pts = nanoseconds(recording_->origin()) + nanoseconds(item.time);
  GST_LOG_OBJECT(pad.get(), "frame at %" GST_TIME_FORMAT, GST_TIME_ARGS(pts));
  return combined(pad, pad.push(frame_buffer(item.frame, &info), pts));
}

/// Sends triggers or IMU samples with the first stream of events, if there is one.
template <class Sample>
GstFlowReturn ReaderOutput::push_to_first(std::span<const Sample> samples) {
  if (const GstFlowReturn begun = begin(); begun != GST_FLOW_OK) return begun;
  std::vector<Sample> of_stream(samples.begin(), samples.end());
  for (auto& sample : of_stream) sample.t += std::max<Microseconds>(recording_->origin(), 0);
  const auto& streams = recording_->streams();
  const auto first = std::ranges::find_if(streams, [](const RecordingReader::Stream& stream) {
    return stream.shown && stream.info.kind == StreamKind::events;
  });
  if (first == streams.end()) return GST_FLOW_OK;
  auto& pad = pad_of(static_cast<std::size_t>(first - streams.begin()));
  gst_pad_push_event(pad.get(), new_sensor_event(std::span<const Sample>(of_stream)));
  return GST_FLOW_OK;
}

GstFlowReturn ReaderOutput::push(const eventcamera::TriggerItem& item) {
  return push_to_first(item.triggers);
}

GstFlowReturn ReaderOutput::push(const eventcamera::ImuItem& item) {
  return push_to_first(item.samples);
}

GstFlowReturn ReaderOutput::combined(ReaderPad& pad, GstFlowReturn result) {
  return gst_flow_combiner_update_pad_flow(combiner_, pad.get(), result);
}

ReaderPad& ReaderOutput::pad_of(std::size_t index) {
  auto& found = pad_of_stream_[index];
  if (found != nullptr) return *found;
  const auto& stream = recording_->streams()[index];
  const char* const kind = stream.info.kind == StreamKind::frames ? "video_" : "events_";
  const auto name = format_.has_many_streams ? kind + std::to_string(stream.number) : "src";
  for (auto& pad : pads_)
    if (pad->name() == name) return *(found = pad.get());
  auto* const templ = gst_element_class_get_pad_template(
      GST_ELEMENT_GET_CLASS(element_),
      format_.has_many_streams ? (kind + std::string("%u")).c_str() : "src");
  found = pads_.emplace_back(std::make_unique<ReaderPad>(templ, name, GST_CAT_DEFAULT)).get();
  gst_pad_set_event_function(
      found->get(), +[](GstPad* pad, GstObject* parent, GstEvent* event) {
        return event_reader_of(parent).src_event(pad, event);
      });
  gst_pad_set_query_function(
      found->get(), +[](GstPad* pad, GstObject* parent, GstQuery* query) {
        return event_reader_of(parent).src_query(pad, query);
      });
  return *found;
}

GstFlowReturn ReaderOutput::begin() {
  if (!std::exchange(is_due_, false)) return GST_FLOW_OK;
  start_streams();
  const auto& streams = recording_->streams();
  for (std::size_t i = 0; i < streams.size(); ++i) {
    if (!streams[i].shown) continue;
    const bool has_size = find_size(i);
    if (!has_size || !send_caps(i)) {
      is_due_ = true;
      return has_size ? pad_of(i).refusal() : GST_FLOW_ERROR;
    }
    send_segment(pad_of(i));
  }
  for (GstEvent* event : std::exchange(waiting_, {})) push_to_pads(event);
  // Writers must know these streams before the first buffer.
  if (format_.has_triggers) push(eventcamera::TriggerItem{});
  if (std::ranges::any_of(streams,
                          [](const auto& stream) { return stream.info.kind == StreamKind::imu; }))
    push(eventcamera::ImuItem{});
  return GST_FLOW_OK;
}

/// Starts streams and adds their pads. With many streams, pads have caps before they are added,
/// except where the linked element may determine the sensor size, as with a single pad.
void ReaderOutput::start_streams() {
  const auto& streams = recording_->streams();
  const bool is_upstreams = timeline_.is_timed() && stream_start_ != nullptr;
  bool is_any_new = false;
  for (std::size_t i = 0; i < streams.size(); ++i) {
    if (!streams[i].shown) continue;
    auto& pad = pad_of(i);
    if (pad.is_started()) continue;
    is_any_new = true;
    if (group_ == GST_GROUP_ID_INVALID) {
      GstEvent* const sticky = gst_pad_get_sticky_event(sink_, GST_EVENT_STREAM_START, 0);
      if (sticky == nullptr || !gst_event_parse_group_id(sticky, &group_))
        group_ = gst_util_group_id_next();
      if (sticky != nullptr) gst_event_unref(sticky);
    }
    if (is_upstreams)
      pad.start_stream(gst_event_ref(stream_start_));
    else
      pad.start_stream(element_, group_);
    if (timeline_.is_timed()) pad.need_segment(false);
    if (!format_.has_many_streams) continue;
    if (streams[i].size_from == RecordingReader::SizeFrom::file) {
      send_caps(i);
      send_segment(pad);
    }
    pad.send_tags(recording_->format_name(), streams[i].info.source);
  }
  if (!is_any_new) return;
  if (!is_upstreams) post_collection();
  for (auto& pad : pads_) {
    if (pad->is_added()) continue;
    gst_flow_combiner_add_pad(combiner_, pad->get());
    gst_element_add_pad(element_, pad->get());
  }
  if (!std::exchange(has_no_more_pads_, true)) gst_element_no_more_pads(element_);
}

/// Announces the streams to applications and downstream.
void ReaderOutput::post_collection() {
  GstStreamCollection* const collection = gst_stream_collection_new(nullptr);
  for (auto& pad : pads_)
    if (GstStream* const stream = gst_pad_get_stream(pad->get()))
      gst_stream_collection_add_stream(collection, stream);
  gst_element_post_message(element_,
                           gst_message_new_stream_collection(GST_OBJECT(element_), collection));
  for (auto& pad : pads_)
    gst_pad_push_event(pad->get(), gst_event_new_stream_collection(collection));
  gst_object_unref(collection);
}

/// If the file does not state the sensor size, uses the properties, else downstream's caps, else a
/// size that most events fit into. False if no sensor is so large.
bool ReaderOutput::find_size(std::size_t index) {
  const auto& stream = recording_->streams()[index];
  if (stream.size_from != RecordingReader::SizeFrom::assumption) return true;
  if (const auto size = settings_.copy().sensor; size.width > 0 && size.height > 0) {
    recording_->set_size(index, size);
    return true;
  }
  GstPad* const pad = pad_of(index).get();
  const OwnedCaps templ(gst_pad_get_pad_template_caps(pad));
  const OwnedCaps peer(gst_pad_peer_query_caps(pad, templ.get()));
  eventcamera::SensorSize size;
  if (!gst_caps_is_empty(peer.get())) {
    const auto* const structure = gst_caps_get_structure(peer.get(), 0);
    if (gst_structure_get_int(structure, "width", &size.width) &&
        gst_structure_get_int(structure, "height", &size.height)) {
      recording_->set_size(index, size);
      return true;
    }
  }
  if (stream.is_implausible) {
    constexpr int max_side = eventcamera::UsedPixels::max_guessed_side;
    post_message(
        element_, GST_MESSAGE_ERROR,
        {GST_STREAM_ERROR_FORMAT,
         "The file does not state its sensor size, and its events lie beyond " +
             eventcamera::in_pixels({max_side, max_side}) +
             ". If that is right, set width and height."},
        "columns and rows may have fractions, or other columns may have been read for them");
    return false;
  }
  const auto text = in_pixels(stream.info.size);
  GST_INFO_OBJECT(element_, "the file does not state the sensor size; assuming %s", text.c_str());
  if (stream.info.mirrored)
    warn_of_assumption_(
        element_,
        {GST_STREAM_ERROR_FORMAT, "The file does not state its sensor size; assuming " + text +
                                      ". If events are in the wrong place, set width and height."},
        "columns and rows of the file count from the far corner");
  return true;
}

bool ReaderOutput::send_caps(std::size_t index) {
  const auto& stream = recording_->streams()[index];
  auto& pad = pad_of(index);
  if (stream.info.kind == StreamKind::events) {
    const bool taken = pad.send_caps(stream.info.size);
    if (!taken)
      GST_DEBUG_OBJECT(pad.get(), "a sensor of %dx%d pixels is refused", stream.info.size.width,
                       stream.info.size.height);
    return taken;
  }
  GstVideoInfo info;
  return pad.has_video() || !frame_video_info(*stream.first_frame, &info) || pad.send_caps(info);
}

/// Handles downstream's refusal of a sensor size that has grown.
GstFlowReturn ReaderOutput::handle_refused_size(std::size_t index) {
  const GstFlowReturn refusal = pad_of(index).refusal();
  if (refusal == GST_FLOW_FLUSHING) return refusal;
  const auto text = in_pixels(recording_->streams()[index].info.size);
  post_message(element_, GST_MESSAGE_ERROR,
               {GST_STREAM_ERROR_FORMAT,
                "Events lie outside the assumed sensor, whose size the file does not state. Set "
                "width and height; the events so far need " +
                    text + "."},
               "downstream refuses to change the size to " + text);
  return GST_FLOW_ERROR;
}

void ReaderOutput::send_segment(ReaderPad& pad) {
  GstSegment segment = timeline_.segment();
  const GstClockTime origin = nanoseconds(recording_->origin());
  segment.start += origin;
  segment.position += origin;
  if (GST_CLOCK_TIME_IS_VALID(segment.stop)) segment.stop += origin;
  pad.send_segment(segment, seqnum_);
}

/// Posts a message with the seqnum of the current seek.
void ReaderOutput::post_with_seqnum(GstMessage* message) {
  if (seqnum_ != GST_SEQNUM_INVALID) gst_message_set_seqnum(message, seqnum_);
  gst_element_post_message(element_, message);
}

void ReaderOutput::post_segment_start() {
  const auto segment = timeline_.segment();
  if ((segment.flags & GST_SEGMENT_FLAG_SEGMENT) != 0)
    post_with_seqnum(gst_message_new_segment_start(GST_OBJECT(element_), GST_FORMAT_TIME,
                                                   static_cast<gint64>(segment.position)));
}

void ReaderOutput::end(bool failed) {
  const auto segment = timeline_.segment();
  if (failed || (segment.flags & GST_SEGMENT_FLAG_SEGMENT) == 0) {
    push_to_pads(with_seqnum(gst_event_new_eos(), seqnum_));
    return;
  }
  const auto position =
      static_cast<gint64>(GST_CLOCK_TIME_IS_VALID(segment.stop) ? segment.stop : segment.position);
  post_with_seqnum(gst_message_new_segment_done(GST_OBJECT(element_), GST_FORMAT_TIME, position));
  push_to_pads(with_seqnum(gst_event_new_segment_done(GST_FORMAT_TIME, position), seqnum_));
}

/// Takes ownership of `event`.
void ReaderOutput::push_to_pads(GstEvent* event) {
  for (auto& pad : pads_) gst_pad_push_event(pad->get(), gst_event_ref(event));
  gst_event_unref(event);
}

void ReaderOutput::forward(GstEvent* event) {
  if (is_due_)
    waiting_.push_back(event);
  else
    push_to_pads(event);
}
