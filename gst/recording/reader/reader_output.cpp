// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/reader/reader_output.hpp"

#include <gst/video/video.h>

#include <cstddef>

#include "gst/recording/frame_buffer.hpp"
#include "gst/recording/sensor_events.hpp"

GST_DEBUG_CATEGORY_EXTERN(event_reader_debug);
#define GST_CAT_DEFAULT event_reader_debug

using namespace eventcamera;

GstEvent* with_seqnum(GstEvent* event, guint32 seqnum) {
  if (seqnum != GST_SEQNUM_INVALID) gst_event_set_seqnum(event, seqnum);
  return event;
}

namespace {

/// Recycles the memory of freed event buffers, from any thread: up to a limit, and only as long as
/// buffers need as much.
class SpareMemory {
 public:
  std::vector<Event> pop() {
    const std::lock_guard lock(mutex_);
    if (count_ == 0) return {};
    auto memory = std::exchange(spare_[--count_], {});
    capacity_ -= memory.capacity();
    return memory;
  }

  void push(std::vector<Event> memory) noexcept {
    constexpr std::size_t min_needed = 512;
    const std::lock_guard lock(mutex_);
    needed_ = std::max({memory.size(), needed_ - needed_ / 64, min_needed});
    const auto capacity = memory.capacity();
    if (capacity / 4 > needed_ || capacity_ + capacity > max_events || count_ == spare_.size())
      return;
    spare_[count_++] = std::move(memory);
    capacity_ += capacity;
  }

 private:
  static constexpr std::size_t max_events = std::size_t{1} << 23;  // 64 MiB

  std::mutex mutex_;
  std::array<std::vector<Event>, 16> spare_;
  std::size_t count_ = 0;     ///< number of them
  std::size_t capacity_ = 0;  ///< of all of them, in events
  std::size_t needed_ = 0;    ///< events of a recent buffer: a maximum that decays
};

}  // namespace

/// Source pad for one stream of a file, with the state of its events: stream-start, caps, tags and
/// segment. Not added to the element at first.
struct ReaderPad {
  ReaderPad(GstPadTemplate* templ, const std::string& pad_name)
      : pad(GST_PAD(gst_object_ref_sink(gst_pad_new_from_template(templ, pad_name.c_str())))),
        name(pad_name) {
    gst_pad_use_fixed_caps(pad.get());
  }

  bool is_added() const { return GST_OBJECT_PARENT(pad.get()) != nullptr; }

  /// Forgets what was sent, for a new stream.
  void reset() {
    interrupt();
    is_started = false;
    size = {};
    video.reset();
  }

  /// Marks the next data as discontinuous; a new segment is due.
  void interrupt() { is_segment_due = is_discontinuous = true; }

  /// Starts a new stream. Event streams have type video, because players draw them.
  void start_stream(GstElement* element, guint group) {
    const bool is_only = name == "src";
    gchar* const id =
        gst_pad_create_stream_id(pad.get(), element, is_only ? nullptr : name.c_str());
    GstStream* const stream =
        gst_stream_new(id, nullptr, GST_STREAM_TYPE_VIDEO, GST_STREAM_FLAG_NONE);
    GstEvent* const event = gst_event_new_stream_start(id);
    gst_event_set_stream(event, stream);
    gst_event_set_group_id(event, group);
    gst_object_unref(stream);
    g_free(id);
    start_stream(event);
  }

  /// Starts a stream with a stream-start event, which it takes.
  void start_stream(GstEvent* event) {
    reset();
    is_started = true;
    if (!GST_PAD_IS_ACTIVE(pad.get())) gst_pad_set_active(pad.get(), TRUE);
    gst_pad_push_event(pad.get(), event);
  }

  /// Sends tags with the file format and the camera model.
  void send_tags(const std::string& format, const std::string& camera) {
    if (!format.empty()) {
      GstTagList* const container =
          gst_tag_list_new(GST_TAG_CONTAINER_FORMAT, format.c_str(), nullptr);
      gst_tag_list_set_scope(container, GST_TAG_SCOPE_GLOBAL);
      gst_pad_push_event(pad.get(), gst_event_new_tag(container));
    }
    if (!camera.empty() &&
        g_utf8_validate(camera.data(), static_cast<gssize>(camera.size()), nullptr))
      gst_pad_push_event(pad.get(), gst_event_new_tag(gst_tag_list_new(GST_TAG_DEVICE_MODEL,
                                                                       camera.c_str(), nullptr)));
  }

  /// Sends caps unless already sent. False if they are refused.
  bool send_caps(SensorSize next) {
    if (next != size && push_caps(event_caps(next).get())) size = next;
    return next == size;
  }
  bool send_caps(const GstVideoInfo& next) {
    if (video && gst_video_info_is_equal(&*video, &next)) return true;
    const bool accepted = push_caps(OwnedCaps(gst_video_info_to_caps(&next)).get());
    if (accepted) video = next;
    return accepted;
  }

  GstFlowReturn push(GstBuffer* buffer, GstClockTime pts) {
    GST_BUFFER_PTS(buffer) = pts;
    if (std::exchange(is_discontinuous, false))
      GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_DISCONT);
    return gst_pad_push(pad.get(), buffer);
  }

  /// Pushes the first `count` events of `memory`, at least one, without copying them, and their
  /// labels, if there are any. Throws std::bad_alloc.
  GstFlowReturn push(std::vector<Event> memory, std::size_t count, std::span<const Label> labels,
                     GstClockTime pts, GstClockTime duration) {
    struct Owner {
      std::shared_ptr<SpareMemory> spare;
      std::vector<Event> memory;
    };
    auto owner = std::make_unique<Owner>(Owner{spare, std::move(memory)});
    auto* const events = owner->memory.data();
    const gsize bytes = count * sizeof(Event);
    OwnedBuffer buffer(gst_buffer_new_wrapped_full(static_cast<GstMemoryFlags>(0), events, bytes, 0,
                                                   bytes, owner.release(), [](gpointer data) {
                                                     const std::unique_ptr<Owner> last(
                                                         static_cast<Owner*>(data));
                                                     last->spare->push(std::move(last->memory));
                                                   }));
    if (!labels.empty()) std::ranges::copy(labels, add_labels(buffer.get(), count).begin());
    GST_BUFFER_DURATION(buffer.get()) = duration;
    return push(buffer.release(), pts);
  }

  /// Flow return after send_caps() failed.
  GstFlowReturn refusal() const {
    return GST_PAD_IS_FLUSHING(pad.get()) ||
                   gst_pad_get_last_flow_return(pad.get()) == GST_FLOW_FLUSHING
               ? GST_FLOW_FLUSHING
               : GST_FLOW_NOT_NEGOTIATED;
  }

  OwnedPad pad;
  std::string name;
  std::shared_ptr<SpareMemory> spare = std::make_shared<SpareMemory>();
  bool is_started = false;
  bool is_segment_due = true;
  bool is_discontinuous = true;       ///< before the next data
  SensorSize size;                    ///< in the caps sent last
  std::optional<GstVideoInfo> video;  ///< in the caps sent last

 private:
  bool push_caps(GstCaps* caps) {
    GST_DEBUG_OBJECT(pad.get(), "sending %" GST_PTR_FORMAT, caps);
    if (GstStream* const stream = gst_pad_get_stream(pad.get())) {
      gst_stream_set_caps(stream, caps);
      gst_object_unref(stream);
    }
    return gst_pad_push_event(pad.get(), gst_event_new_caps(caps)) != FALSE;
  }
};

ReaderOutput::ReaderOutput(GstElement* element, GstPad* sink, const EventReaderFormat& format,
                           Guarded<FormatSettings>& settings, ReaderTimeline& timeline,
                           GstPadEventFunction src_event, GstPadQueryFunction src_query)
    : element_(element),
      sink_(sink),
      format_(format),
      settings_(settings),
      timeline_(timeline),
      src_event_(src_event),
      src_query_(src_query),
      warn_of_assumption_(event_reader_debug) {}

ReaderOutput::~ReaderOutput() = default;

void ReaderOutput::reset() {
  waiting_.clear();
  stream_start_.reset();
  set_recording(nullptr);
  warn_of_assumption_.reset();
  for (auto& pad : pads_) {
    pad->reset();
    if (!format_.has_many_streams) continue;
    gst_flow_combiner_remove_pad(combiner_.get(), pad->pad.get());
    if (pad->is_added()) gst_element_remove_pad(element_, pad->pad.get());
  }
  if (format_.has_many_streams) {
    pads_.clear();
    has_no_more_pads_ = false;
  }
  gst_flow_combiner_reset(combiner_.get());
  group_ = GST_GROUP_ID_INVALID;
  seqnum_ = GST_SEQNUM_INVALID;
}

void ReaderOutput::set_recording(std::shared_ptr<RecordingReader> recording) {
  recording_ = std::move(recording);
  pad_of_stream_.clear();
  is_due_ = true;
}

void ReaderOutput::start_stream(GstEvent* stream_start) {
  stream_start_.reset(stream_start);
  for (auto& pad : pads_) pad->reset();
  group_ = GST_GROUP_ID_INVALID;
  is_due_ = true;
}

void ReaderOutput::interrupt() {
  for (auto& pad : pads_) pad->interrupt();
  is_due_ = true;
}

void ReaderOutput::interrupt_data() {
  for (auto& pad : pads_) pad->is_discontinuous = true;
}

void ReaderOutput::flush() {
  waiting_.clear();
  gst_flow_combiner_reset(combiner_.get());
  interrupt();
}

void ReaderOutput::expect_segment() {
  for (auto& pad : pads_) pad->is_segment_due = false;
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
  GST_LOG_OBJECT(pad.pad.get(),
                 "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT " for %" GST_TIME_FORMAT,
                 chunk.events.size(), GST_TIME_ARGS(pts), GST_TIME_ARGS(duration));
  if (chunk.events.empty())
    return combined(pad, push_event(pad.pad.get(), gst_event_new_gap(pts, duration)));
  auto memory = pad.spare->pop();
  recording_->swap_memory(chunk.stream, memory);
  const auto count = chunk.events.size();
  return combined(pad, pad.push(std::move(memory), count, chunk.labels, pts, duration));
}

GstFlowReturn ReaderOutput::push(const RecordingReader::TimedFrame& item) {
  if (const GstFlowReturn begun = begin(); begun != GST_FLOW_OK) return begun;
  auto& pad = *pad_of_stream_.at(item.stream);
  GstVideoInfo info;
  if (!frame_video_info(item.frame, &info)) return GST_FLOW_OK;
  if (!pad.send_caps(info) && GST_PAD_IS_FLUSHING(pad.pad.get())) return GST_FLOW_FLUSHING;
  const GstClockTime pts = nanoseconds(recording_->origin()) + nanoseconds(item.time);
  GST_LOG_OBJECT(pad.pad.get(), "frame at %" GST_TIME_FORMAT, GST_TIME_ARGS(pts));
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
  gst_pad_push_event(pad.pad.get(), new_sensor_event(std::span<const Sample>(of_stream)));
  return GST_FLOW_OK;
}

GstFlowReturn ReaderOutput::push(const TriggerItem& item) {
  return push_to_first(item.triggers);
}

GstFlowReturn ReaderOutput::push(const ImuItem& item) {
  return push_to_first(item.samples);
}

GstFlowReturn ReaderOutput::combined(ReaderPad& pad, GstFlowReturn result) {
  return gst_flow_combiner_update_pad_flow(combiner_.get(), pad.pad.get(), result);
}

ReaderPad& ReaderOutput::pad_of(std::size_t index) {
  auto& found = pad_of_stream_[index];
  if (found != nullptr) return *found;
  const auto& stream = recording_->streams()[index];
  const char* const kind = stream.info.kind == StreamKind::frames ? "video_" : "events_";
  const auto name = format_.has_many_streams ? kind + std::to_string(stream.number) : "src";
  for (auto& pad : pads_)
    if (pad->name == name) return *(found = pad.get());
  auto* const templ = gst_element_class_get_pad_template(
      GST_ELEMENT_GET_CLASS(element_),
      format_.has_many_streams ? (kind + std::string("%u")).c_str() : "src");
  found = pads_.emplace_back(std::make_unique<ReaderPad>(templ, name)).get();
  gst_pad_set_event_function(found->pad.get(), src_event_);
  gst_pad_set_query_function(found->pad.get(), src_query_);
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
  for (auto& event : std::exchange(waiting_, {})) push_to_pads(event.release());
  // Writers must know these streams before the first buffer.
  if (format_.has_triggers) push(TriggerItem{});
  if (std::ranges::any_of(streams,
                          [](const auto& stream) { return stream.info.kind == StreamKind::imu; }))
    push(ImuItem{});
  return GST_FLOW_OK;
}

/// Starts streams and adds their pads. With many streams, pads have caps before they are added,
/// except where the linked element may determine the sensor size, as with a single pad.
void ReaderOutput::start_streams() {
  const auto& streams = recording_->streams();
  const bool is_upstreams = timeline_.is_timed() && stream_start_;
  bool is_any_new = false;
  for (std::size_t i = 0; i < streams.size(); ++i) {
    if (!streams[i].shown) continue;
    auto& pad = pad_of(i);
    if (pad.is_started) continue;
    is_any_new = true;
    if (group_ == GST_GROUP_ID_INVALID) {
      GstEvent* const sticky = gst_pad_get_sticky_event(sink_, GST_EVENT_STREAM_START, 0);
      if (sticky == nullptr || !gst_event_parse_group_id(sticky, &group_))
        group_ = gst_util_group_id_next();
      if (sticky != nullptr) gst_event_unref(sticky);
    }
    if (is_upstreams)
      pad.start_stream(gst_event_ref(stream_start_.get()));
    else
      pad.start_stream(element_, group_);
    if (timeline_.is_timed()) pad.is_segment_due = false;
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
    gst_flow_combiner_add_pad(combiner_.get(), pad->pad.get());
    gst_element_add_pad(element_, pad->pad.get());
  }
  if (!std::exchange(has_no_more_pads_, true)) gst_element_no_more_pads(element_);
}

void ReaderOutput::post_collection() {
  GstStreamCollection* const collection = gst_stream_collection_new(nullptr);
  for (auto& pad : pads_)
    if (GstStream* const stream = gst_pad_get_stream(pad->pad.get()))
      gst_stream_collection_add_stream(collection, stream);
  gst_element_post_message(element_,
                           gst_message_new_stream_collection(GST_OBJECT(element_), collection));
  for (auto& pad : pads_)
    gst_pad_push_event(pad->pad.get(), gst_event_new_stream_collection(collection));
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
  GstPad* const pad = pad_of(index).pad.get();
  const OwnedCaps templ(gst_pad_get_pad_template_caps(pad));
  const OwnedCaps peer(gst_pad_peer_query_caps(pad, templ.get()));
  SensorSize size;
  if (!gst_caps_is_empty(peer.get())) {
    const auto* const structure = gst_caps_get_structure(peer.get(), 0);
    if (gst_structure_get_int(structure, "width", &size.width) &&
        gst_structure_get_int(structure, "height", &size.height)) {
      recording_->set_size(index, size);
      return true;
    }
  }
  if (stream.is_implausible) {
    constexpr int side = UsedPixels::max_guessed_side;
    post_message(
        element_, GST_MESSAGE_ERROR,
        {GST_STREAM_ERROR_FORMAT,
         "The file does not state its sensor size, and its events lie beyond " +
             in_pixels({side, side}) + ". If that is right, set width and height."},
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
    const bool accepted = pad.send_caps(stream.info.size);
    if (!accepted)
      GST_DEBUG_OBJECT(pad.pad.get(), "a sensor of %dx%d pixels is refused", stream.info.size.width,
                       stream.info.size.height);
    return accepted;
  }
  GstVideoInfo info;
  return pad.video || !frame_video_info(*stream.first_frame, &info) || pad.send_caps(info);
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

/// Sends the segment if it is due.
void ReaderOutput::send_segment(ReaderPad& pad) {
  if (!std::exchange(pad.is_segment_due, false)) return;
  GstSegment segment = timeline_.segment();
  const GstClockTime origin = nanoseconds(recording_->origin());
  segment.start += origin;
  segment.position += origin;
  if (GST_CLOCK_TIME_IS_VALID(segment.stop)) segment.stop += origin;
  gst_pad_push_event(pad.pad.get(), with_seqnum(gst_event_new_segment(&segment), seqnum_));
}

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
  for (auto& pad : pads_) gst_pad_push_event(pad->pad.get(), gst_event_ref(event));
  gst_event_unref(event);
}

void ReaderOutput::forward(GstEvent* event) {
  if (is_due_)
    waiting_.emplace_back(event);
  else
    push_to_pads(event);
}
