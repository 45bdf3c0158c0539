// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-aedatmux
 * @title: aedatmux
 * @short_description: writes AEDAT 4, events and frames in one file
 *
 * Writes one event stream, one video stream, or both, in time order. The times in the file are
 * the event stream's, floor(PTS / 1000) + t microseconds; video is synchronised to it.
 *
 * A link without a pad name, `queue ! mux.`, takes either, and learns which from its caps. The pads
 * `events_0` and `video_0` take one kind, for applications that request pads by name.
 *
 * Frames of #aedatdemux keep their exposure times and their position on the sensor. Its triggers
 * and IMU samples arrive with the events. The property `stats` counts what was written.
 *
 * A flushing seek truncates the file and starts over. Events that are earlier than those already
 * written, or outside the sensor, are dropped; a warning says how many.
 *
 * The file is written sequentially, so it can be streamed over a network. If downstream can seek,
 * as filesink can, the file ends with a table of its packets, for fast seeks and an exact duration.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=in.raw ! decodebin caps="application/x-event-camera,format=XYTP"
 * ! aedatmux compression=zstd ! filesink location=out.aedat4
 * gst-launch-1.0 filesrc location=davis.aedat4 ! aedatdemux name=d  d.events_0 ! queue ! m.
 * d.video_0 ! queue ! m.  aedatmux name=m ! filesink location=copy.aedat4
 * ]|
 *
 * Since: 0.1
 */
#include <gst/base/gstaggregator.h>
#include <gst/video/video.h>

#include <atomic>
#include <stdexcept>
#include <string_view>

#include "gst/aggregator/sink_pads.hpp"
#include "gst/base/buffer_bytes.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/properties.hpp"
#include "gst/base/video_frame.hpp"
#include "gst/recording/file_extensions.hpp"
#include "gst/recording/frame_buffer.hpp"
#include "gst/recording/sensor_events.hpp"
#include "gst/recording/writable_events.hpp"
#include "src/formats/aedat/aedat4_encoder.hpp"
#include "src/formats/waiting_items.hpp"

GST_DEBUG_CATEGORY_STATIC(aedat_mux_debug);
#define GST_CAT_DEFAULT aedat_mux_debug

using namespace eventcamera;

namespace {

/// An AEDAT 4 file that is being written: knows its streams, and makes its bytes.
class AedatFile {
 public:
  using Bytes = std::vector<guint8>;

  explicit AedatFile(GstElement* element)
      : writable(element, GST_CAT_DEFAULT, GST_STREAM_ERROR_MUX), element_(element) {}

  /// Sets the sensor of the events. False, after an error message, if the file has another sensor.
  bool handle_sensor(SensorSize size) {
    if (encoder_ && !writable.accepts(size)) return false;
    size_ = size;
    return true;
  }

  void set_video(const GstVideoInfo& video) { video_ = video; }
  void set_source(const gchar* name) { source_ = name; }
  /// Queues the triggers or IMU samples of an event for the next buffer. False for other events.
  bool handle_items(GstEvent* event) {
    return queue(triggers_of(event), triggers_) || queue(imu_samples_of(event), imu_samples_);
  }

  /// True if too many items are queued to wait for a buffer.
  bool is_full() const {
    const auto is_full = [](const auto& waiting) { return waiting && waiting->is_full(); };
    return is_full(triggers_) || is_full(imu_samples_);
  }

  bool has_sensor() const { return size_ != SensorSize{}; }
  bool has_video() const { return video_.has_value(); }
  bool has_begun() const { return encoder_ != nullptr; }

  /// Returns the header. `settings` has the compression, and whether there are frames and a table.
  Bytes begin(Aedat4Settings settings) {
    settings.size = size_;
    if (!has_sensor() && video_)
      settings.size = {GST_VIDEO_INFO_WIDTH(&*video_), GST_VIDEO_INFO_HEIGHT(&*video_)};
    settings.source = source_;
    settings.triggers = triggers_.has_value();
    settings.imu_samples = imu_samples_.has_value();
    writable.begin_file(size_);
    GST_DEBUG_OBJECT(element_, "beginning a file of %dx%d pixels%s%s%s, %s a table of packets",
                     settings.size.width, settings.size.height, settings.frames ? ", frames" : "",
                     settings.triggers ? ", triggers" : "",
                     settings.imu_samples ? ", IMU samples" : "",
                     settings.table ? "with" : "without");
    encoder_ = std::make_unique<Aedat4Encoder>(settings);
    Bytes header;
    encoder_->flush(header);
    return header;
  }

  Bytes write_items() {
    Bytes out;
    const auto triggers = encode(triggers_, "triggers", out);
    const auto imu_samples = encode(imu_samples_, "IMU samples", out);
    const auto written = writable.written().lock();
    written->triggers += triggers;
    written->imu_samples += imu_samples;
    return out;
  }

  /// Encodes the items that wait and a buffer of time `t`: events, a frame, or neither if empty.
  Bytes write(GstBuffer* buffer, Microseconds t, bool has_events) {
    Bytes out = write_items();
    if (gst_buffer_get_size(buffer) > 0)
      has_events ? write_events(buffer, out) : write_frame(buffer, t, out);
    if (t - flushed_ >= max_wait) {
      flushed_ = t;
      encoder_->flush(out);
    }
    return out;
  }

  /// Ends incomplete packets.
  Bytes flush() {
    Bytes out = write_items();
    encoder_->flush(out);
    return out;
  }

  Bytes finish() {
    writable.end_file();
    Bytes bytes = write_items();
    encoder_->finish(bytes);
    return bytes;
  }

  /// Bytes of the header to overwrite after finish().
  std::optional<FilePatch> patch() { return encoder_->patch(); }

  void warn_skipped(const char* what, const std::string& cause) {
    warn_(element_, {GST_STREAM_ERROR_MUX, std::string("Dropped ") + what + "."}, cause);
  }

  /// Starts a new file of the same streams.
  void start_over() {
    encoder_.reset();
    triggers_.reset();
    imu_samples_.reset();
    flushed_ = 0;
    warn_.reset();
  }

  /// Forgets the streams, too.
  void reset() {
    if (encoder_) writable.end_file();
    start_over();
    size_ = {};
    video_.reset();
    source_.clear();
  }

  WritableEvents writable;

 private:
  /// Maximum time that events wait to be written as a packet.
  static constexpr Microseconds max_wait = 100'000;

  /// Items that wait for the next buffer. Set once they are announced, so that the header has a
  /// stream for them.
  template <class Item>
  using Waiting = std::optional<WaitingItems<Item>>;

  template <class Item>
  bool queue(std::optional<std::vector<Item>>&& items, Waiting<Item>& waiting) {
    if (!items) return false;
    if (!waiting) waiting.emplace();
    waiting->push(*items);
    return true;
  }

  /// Encodes the waiting items of a stream, and returns how many were written.
  template <class Item>
  std::size_t encode(Waiting<Item>& waiting, const char* name, Bytes& out) {
    const std::span<const Item> items =
        waiting ? waiting->pop_before(after_all_items) : std::span<Item>();
    const auto count = encoder_->encode(items, out);
    if (!items.empty())
      GST_LOG_OBJECT(element_, "wrote %" G_GSIZE_FORMAT " of %" G_GSIZE_FORMAT " %s", count,
                     items.size(), name);
    return count;
  }

  void write_events(GstBuffer* buffer, Bytes& out) {
    const MappedEvents mapped(buffer);
    if (!mapped)
      return warn_skipped("a buffer with a partial event",
                          std::to_string(gst_buffer_get_size(buffer)) + " bytes");
    GST_LOG_OBJECT(element_, "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT,
                   mapped.events().size(), GST_TIME_ARGS(GST_BUFFER_PTS(buffer)));
    encoder_->encode(writable.pick(mapped.events(), writable.time_of(GST_BUFFER_PTS(buffer))), out);
  }

  void write_frame(GstBuffer* buffer, Microseconds t, Bytes& out) {
    GST_LOG_OBJECT(element_, "frame at %" G_GINT64_FORMAT " us", gint64{t});
    const auto reject = [&](const char* cause) {
      warn_skipped("a frame that does not fit into the file",
                   std::string(cause) + ", at " + std::to_string(t) + " us");
    };
    if (!video_) return reject("no caps");
    const VideoFrame video(*video_, buffer, GST_MAP_READ);
    if (!video) return reject(video.fault().c_str());
    const auto frame = recorded_frame(video.get(), t);
    try {
      encoder_->encode(frame, out);
      ++writable.written().lock()->frames;
    } catch (const std::invalid_argument& error) {
      reject(error.what());
    }
  }

  GstElement* element_;
  WarnOnce warn_{GST_CAT_DEFAULT};

  SensorSize size_;  ///< of the event stream
  std::optional<GstVideoInfo> video_;
  std::string source_;
  Waiting<Trigger> triggers_;
  Waiting<ImuSample> imu_samples_;

  std::unique_ptr<Aedat4Encoder> encoder_;  ///< null until the header is written
  Microseconds flushed_ = 0;                ///< time of the last flushed packet
};

struct Settings {
  Aedat4Compression compression = Aedat4Compression::lz4;
};

using Pad = OwnedAggregatorPad;

struct Private {
  explicit Private(GstElement* of) : element(of), file(of) {}

  GstElement* const element;
  Guarded<Settings> settings;
  std::atomic<bool> has_header = false;  ///< no pads can be added
  AedatFile file;
  std::optional<GstSegment> segment;  ///< of the events written last
  /// Pads whose caps were handled last. A pad stores its caps later, in the thread that pushed
  /// them.
  const GstAggregatorPad* events_pad = nullptr;
  const GstAggregatorPad* video_pad = nullptr;
};

}  // namespace

DEFINE_EVENT_ELEMENT(GstAedatMux, gst_aedat_mux, AEDAT_MUX, GstAggregator, GST_TYPE_AGGREGATOR,
                     aedatmux, GST_RANK_PRIMARY, "AEDAT 4 muxer")
#define PARENT_AGGREGATOR_CLASS GST_AGGREGATOR_CLASS(gst_aedat_mux_parent_class)

#define EVENTS_CAPS EVENT_CAPS ", framerate = (fraction) [ 0, max ]"

constexpr const char* any_pad = "sink_%u";

enum class Kind { events, video, unknown };

static Kind kind_of(const GstCaps* caps) {
  bool has_events = false;
  bool has_video = false;
  for (guint i = 0; i < gst_caps_get_size(caps); ++i)
    (gst_structure_has_name(gst_caps_get_structure(caps, i), GST_EVENT_CAMERA_MEDIA_TYPE)
         ? has_events
         : has_video) = true;
  if (has_events == has_video) return Kind::unknown;
  return has_events ? Kind::events : Kind::video;
}

/// Kind of the stream of a pad, according to its current or template caps.
static Kind kind_of(GstAggregatorPad* pad) {
  OwnedCaps caps(gst_pad_get_current_caps(GST_PAD(pad)));
  if (!caps) caps.reset(gst_pad_get_pad_template_caps(GST_PAD(pad)));
  return kind_of(caps.get());
}

/// Segment of a pad, if it is in time format.
static std::optional<GstSegment> segment_of(GstAggregatorPad* pad) {
  GST_OBJECT_LOCK(pad);
  const GstSegment segment = pad->segment;
  GST_OBJECT_UNLOCK(pad);
  if (segment.format != GST_FORMAT_TIME) return std::nullopt;
  return segment;
}

/// Running time at which a buffer is written: its start, or the end of a gap, until
/// which its pad has nothing to wait for.
static GstClockTime due_time(GstAggregatorPad* pad, GstBuffer* buffer) {
  const auto segment = segment_of(pad);
  GstClockTime time = GST_BUFFER_PTS(buffer);
  if (!segment || time > segment->stop) return 0;
  if (gst_buffer_get_size(buffer) == 0 && GST_BUFFER_DURATION_IS_VALID(buffer))
    time += std::min(GST_BUFFER_DURATION(buffer), segment->stop - time);
  const auto running = gst_segment_to_running_time(&*segment, GST_FORMAT_TIME, time);
  return GST_CLOCK_TIME_IS_VALID(running) ? running : 0;
}

/// Returns the pad with the earliest next buffer; a buffer without a time comes first, and events
/// come before a frame of the same time. Null if no pad has a buffer.
static Pad earliest_pad(Private& self, GstClockTime* time) {
  Pad earliest;
  for (Pad& pad : sink_pads(self.element)) {
    const auto buffer = next_buffer(pad.get());
    if (!buffer) continue;
    const GstClockTime from = due_time(pad.get(), buffer.get());
    if (earliest && from > *time) continue;
    if (earliest && from == *time && kind_of(pad.get()) != Kind::events) continue;
    *time = from;
    earliest = std::move(pad);
  }
  return earliest;
}

static GstFlowReturn push_bytes(Private& self, AedatFile::Bytes bytes, bool header = false) {
  if (bytes.empty()) return GST_FLOW_OK;
  GstBuffer* const buffer = owning_buffer(std::move(bytes));
  if (header) GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_HEADER);
  return gst_aggregator_finish_buffer(GST_AGGREGATOR(self.element), buffer);
}

static void send_caps(Private& self, const AedatFile::Bytes& header) {
  const OwnedBuffer buffer(copied_buffer(std::as_bytes(std::span(header))));
  const OwnedCaps caps = with_stream_header(
      OwnedCaps(gst_caps_new_simple("application/x-aedat", "version", G_TYPE_INT, 4, nullptr)),
      buffer.get());
  gst_aggregator_set_src_caps(GST_AGGREGATOR(self.element), caps.get());
}

/// Positions the next buffer at `position` in the file.
static void send_segment(Private& self, guint64 position) {
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_BYTES);
  segment.start = segment.time = segment.position = position;
  gst_aggregator_update_segment(GST_AGGREGATOR(self.element), &segment);
}

static GstFlowReturn begin_file(Private& self) {
  self.has_header = true;
  Aedat4Settings settings;
  settings.frames = std::ranges::any_of(
      sink_pads(self.element), [](const Pad& pad) { return kind_of(pad.get()) != Kind::events; });
  settings.table = peer_can_seek(GST_AGGREGATOR_SRC_PAD(self.element), GST_FORMAT_BYTES);
  settings.compression = self.settings.copy().compression;
  auto header = self.file.begin(std::move(settings));
  send_caps(self, header);
  send_segment(self, 0);
  return push_bytes(self, std::move(header), true);
}

static GstFlowReturn end_file(Private& self) {
  auto& file = self.file;
  const GstFlowReturn result = push_bytes(self, file.finish());
  auto patch = file.patch();
  GST_DEBUG_OBJECT(self.element, "the file ends%s", patch ? "; completing its header" : "");
  if (result != GST_FLOW_OK || !patch) return result;
  send_segment(self, patch->position);
  return push_bytes(self, std::move(patch->bytes));
}

/// Segment of the events written last, else of the first ones; none without events.
static std::optional<GstSegment> segment_of_events(Private& self) {
  if (const auto& segment = self.segment) return segment;
  for (const Pad& pad : sink_pads(self.element))
    if (kind_of(pad.get()) == Kind::events) return segment_of(pad.get());
  return std::nullopt;
}

/// Time of a frame in the file: the time of events at its running time, or its own PTS if there are
/// none.
static Microseconds frame_time(Private& self, GstBuffer* frame, GstClockTime running) {
  GstClockTime time = GST_BUFFER_PTS(frame);
  const auto segment = segment_of_events(self);
  if (segment &&
      gst_segment_position_from_running_time_full(&*segment, GST_FORMAT_TIME, running, &time) < 0)
    time = 0;  // timestamps are not negative
  return self.file.writable.time_of(time);
}

static GstFlowReturn write_next(Private& self) {
  auto& file = self.file;
  GstClockTime time = 0;
  const Pad pad = earliest_pad(self, &time);
  if (!pad) return GST_AGGREGATOR_FLOW_NEED_DATA;
  const OwnedBuffer buffer(gst_aggregator_pad_pop_buffer(pad.get()));
  if (!buffer) return GST_AGGREGATOR_FLOW_NEED_DATA;
  const auto segment = segment_of(pad.get());
  const GstClockTime running = segment ? gst_segment_to_running_time(&*segment, GST_FORMAT_TIME,
                                                                     GST_BUFFER_PTS(buffer.get()))
                                       : GST_CLOCK_TIME_NONE;
  if (!GST_CLOCK_TIME_IS_VALID(running)) {
    file.warn_skipped("a buffer without a timestamp, or outside its segment",
                      "pad " + std::string(GST_PAD_NAME(pad.get())) + ", no running time");
    return GST_FLOW_OK;
  }
  const bool of_events = kind_of(pad.get()) == Kind::events;
  const Microseconds t = of_events ? file.writable.time_of(GST_BUFFER_PTS(buffer.get()))
                                   : frame_time(self, buffer.get(), running);
  if (of_events) self.segment = segment;
  return push_bytes(self, file.write(buffer.get(), t, of_events));
}

static bool is_at_end(const Pad& pad) {
  return has_ended(pad.get());
}

/// True if enough is known to write the header: the caps, and the announcements before the first
/// buffer.
static bool is_known(Private& self) {
  const auto& file = self.file;
  if (file.has_sensor())
    return std::ranges::all_of(sink_pads(self.element), [](const Pad& pad) {
      return kind_of(pad.get()) != Kind::events || is_at_end(pad) || next_buffer(pad.get());
    });
  return file.has_video() && std::ranges::all_of(sink_pads(self.element), [](const Pad& pad) {
           return kind_of(pad.get()) == Kind::video || is_at_end(pad);
         });
}

/// Forgets the ends of segments that all inputs have reached, and returns one of them. Null if all
/// have reached EOS.
static OwnedEvent pop_segment_ends(Private& self) {
  OwnedEvent done;
  for (const Pad& pad : sink_pads(self.element)) {
    auto end = segment_end_of(pad.get());
    if (!end) continue;
    done = std::move(end);
    forget_segment_end(pad.get());
    gst_aggregator_pad_drop_buffer(pad.get());
  }
  return done;
}

/// Writes the header, the earliest buffer, or the end of a segment or file.
static GstFlowReturn write_some(Private& self) {
  auto& file = self.file;
  const bool ended = std::ranges::all_of(sink_pads(self.element), is_at_end);
  if (!file.has_begun()) {
    if (!is_known(self)) {
      if (!ended) return GST_AGGREGATOR_FLOW_NEED_DATA;
      GST_ELEMENT_ERROR(self.element, STREAM, MUX,
                        ("No stream to write. Link events or video to the muxer."),
                        ("no pad had caps before the end of the stream"));
      return GST_FLOW_ERROR;
    }
    const GstFlowReturn result = begin_file(self);
    if (result != GST_FLOW_OK) return result;
  }
  if (!ended) return write_next(self);
  if (OwnedEvent done = pop_segment_ends(self)) {
    const GstFlowReturn result = push_bytes(self, file.flush());
    gst_pad_push_event(GST_AGGREGATOR_SRC_PAD(self.element), done.release());
    return result;
  }
  const GstFlowReturn result = end_file(self);
  return result == GST_FLOW_OK ? GST_FLOW_EOS : result;
}

template <class Work>
static GstFlowReturn reported(Private& self, const Work& work) {
  return catch_exceptions(
      self.element,
      [](const auto& error) {
        return WritableEvents::failure(error, {GST_STREAM_ERROR_MUX, "Cannot write the file."});
      },
      work);
}

static GstFlowReturn aggregate(GstAggregator* aggregator, gboolean /*timeout*/) {
  auto& self = priv_of(aggregator);
  return reported(self, [&] { return write_some(self); });
}

/// Live pipelines wait for other pads until the running time of the earliest buffer, once the file
/// has begun or can begin.
static GstClockTime get_next_time(GstAggregator* aggregator) {
  auto& self = priv_of(aggregator);
  GstClockTime time = GST_CLOCK_TIME_NONE;
  reported(self, [&] {
    if (self.file.has_begun() || is_known(self)) earliest_pad(self, &time);
    return GST_FLOW_OK;
  });
  return time;
}

static bool handle_caps(Private& self, GstAggregatorPad* pad, const GstCaps* caps) {
  auto& file = self.file;
  const Kind kind = kind_of(caps);
  auto& latest = kind == Kind::events ? self.events_pad : self.video_pad;
  for (const Pad& other : sink_pads(self.element)) {
    if (other.get() == pad || (other.get() != latest && kind_of(other.get()) != kind)) continue;
    GST_ELEMENT_ERROR(self.element, STREAM, MUX,
                      ("Cannot write two streams of %s into one file; link one stream of events "
                       "and one of video.",
                       kind == Kind::events ? "events" : "video"),
                      ("pads %s and %s", GST_PAD_NAME(other.get()), GST_PAD_NAME(pad)));
    return false;
  }
  for (auto* const of_kind : {&self.events_pad, &self.video_pad})
    if (*of_kind == pad) *of_kind = nullptr;
  latest = pad;
  if (kind == Kind::video) {
    GstVideoInfo video;
    if (!gst_video_info_from_caps(&video, caps)) return false;
    file.set_video(video);
    return true;
  }
  const auto sensor = sensor_of(caps);
  return sensor && file.handle_sensor(*sensor);
}

static GstFlowReturn sink_event_pre_queue(GstAggregator* aggregator, GstAggregatorPad* pad,
                                          GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT_DONE) event = gap_at_segment_end(pad, event);
  return PARENT_AGGREGATOR_CLASS->sink_event_pre_queue(aggregator, pad, event);
}

/// Writes the triggers and IMU samples if too many wait for a buffer.
static GstFlowReturn write_waiting(Private& self) {
  auto& file = self.file;
  if (!file.is_full()) return GST_FLOW_OK;
  if (!file.has_begun())
    if (const GstFlowReturn begun = begin_file(self); begun != GST_FLOW_OK) return begun;
  return push_bytes(self, file.write_items());
}

static gboolean sink_event(GstAggregator* aggregator, GstAggregatorPad* pad, GstEvent* event) {
  auto& self = priv_of(aggregator);
  auto& file = self.file;
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT) {
    if (!plays_forwards(self.element, event, "write")) return FALSE;
    if (kind_of(pad) == Kind::events)
      file.writable.begin_segment(segment_of(event), is_simulated(GST_PAD(pad)));
  }
  if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
    GstCaps* const caps = caps_of(event);
    GST_DEBUG_OBJECT(pad, "%" GST_PTR_FORMAT, caps);
    if (!handle_caps(self, pad, caps)) {
      gst_event_unref(event);
      return FALSE;
    }
  } else if (file.handle_items(event)) {
    gst_event_unref(event);
    return reported(self, [&] { return write_waiting(self); }) == GST_FLOW_OK;
  } else if (GST_EVENT_TYPE(event) == GST_EVENT_TAG) {
    GstTagList* tags = nullptr;
    gchar* source = nullptr;
    gst_event_parse_tag(event, &tags);
    if (gst_tag_list_get_string(tags, GST_TAG_DEVICE_MODEL, &source)) file.set_source(source);
    g_free(source);
  } else if (GST_EVENT_TYPE(event) == GST_EVENT_GAP) {
    store_segment_end(pad, event);
  } else if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP) {
    forget_segment_end(pad);
  }
  return PARENT_AGGREGATOR_CLASS->sink_event(aggregator, pad, event);
}

static gboolean src_event(GstAggregator* aggregator, GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_SEEK)
    return PARENT_AGGREGATOR_CLASS->src_event(aggregator, event);
  GST_DEBUG_OBJECT(aggregator, "a file is written once, from its start: refused %" GST_PTR_FORMAT,
                   event);
  gst_event_unref(event);
  return FALSE;
}

static gboolean src_query(GstAggregator* aggregator, GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_SEEKING)
    return PARENT_AGGREGATOR_CLASS->src_query(aggregator, query);
  GstFormat format = GST_FORMAT_UNDEFINED;
  gst_query_parse_seeking(query, &format, nullptr, nullptr, nullptr);
  gst_query_set_seeking(query, format, FALSE, 0, -1);
  return TRUE;
}

static GstAggregatorPad* create_new_pad(GstAggregator* aggregator, GstPadTemplate* templ,
                                        const gchar* wanted, const GstCaps* caps) {
  auto& self = priv_of(aggregator);
  const std::string_view kind = GST_PAD_TEMPLATE_NAME_TEMPLATE(templ);
  if (self.has_header) {
    GST_WARNING_OBJECT(self.element, "the header is already written, without a stream for pad %s",
                       kind.data());
    return nullptr;
  }
  if (kind == any_pad)
    return PARENT_AGGREGATOR_CLASS->create_new_pad(aggregator, templ, wanted, caps);
  const auto is_of_kind = [&](const Pad& pad) { return GST_PAD_PAD_TEMPLATE(pad.get()) == templ; };
  if (std::ranges::any_of(sink_pads(self.element), is_of_kind)) {
    GST_WARNING_OBJECT(self.element, "pad %s already exists", kind.data());
    return nullptr;
  }
  const auto first = std::string(kind.substr(0, kind.find('%'))) + '0';
  return static_cast<GstAggregatorPad*>(
      g_object_new(GST_TYPE_AGGREGATOR_PAD, "name", wanted != nullptr ? wanted : first.c_str(),
                   "direction", GST_PAD_SINK, "template", templ, nullptr));
}

static gboolean start(GstAggregator* aggregator) {
  send_segment(priv_of(aggregator), 0);
  return TRUE;
}

static gboolean stop(GstAggregator* aggregator) {
  auto& self = priv_of(aggregator);
  self.file.reset();
  self.segment.reset();
  self.events_pad = nullptr;
  self.video_pad = nullptr;
  self.has_header = false;
  pop_segment_ends(self);
  return TRUE;
}

/// After a flush, filesink has truncated the file, so start with a new header.
static GstFlowReturn flush(GstAggregator* aggregator) {
  auto& self = priv_of(aggregator);
  GST_DEBUG_OBJECT(aggregator, "flushed: beginning a new file");
  self.has_header = false;
  self.file.start_over();
  self.segment.reset();
  return GST_FLOW_OK;
}

static void gst_aedat_mux_init(GstAedatMux* self) {
  self->priv = new Private(GST_ELEMENT(self));
}

static void gst_aedat_mux_class_init(GstAedatMuxClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;
  Properties<field_of<&Private::settings>> properties(object_class);
  properties.add_fixed(
      &Settings::compression, "compression", "Compression of the file",
      enum_type<Aedat4Compression>(
          "GstAedatCompression",
          {{Aedat4Compression::none, "No compression", "none"},
           {Aedat4Compression::lz4, "LZ4, the fastest", "lz4"},
           {Aedat4Compression::lz4_high, "LZ4, slower and smaller", "lz4-high"},
           {Aedat4Compression::zstd, "Zstandard", "zstd"},
           {Aedat4Compression::zstd_high, "Zstandard, the smallest", "zstd-high"}}));
  install_stats(
      object_class, [](GObject* object) { return priv_of(object).file.writable.stats(); },
      WritableEvents::stats_blurb);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  const auto add_sinks = [&](const char* name, const char* caps) {
    add_pad_template(element_class, name, GST_PAD_SINK, caps, GST_PAD_REQUEST,
                     GST_TYPE_AGGREGATOR_PAD);
  };
  add_sinks(any_pad, EVENTS_CAPS "; " RECORDED_VIDEO_CAPS);  // first: for links without a pad name
  add_sinks("events_%u", EVENTS_CAPS);
  add_sinks("video_%u", RECORDED_VIDEO_CAPS);
  add_pad_template(element_class, "src", GST_PAD_SRC, "application/x-aedat, version = (int) 4",
                   GST_PAD_ALWAYS, GST_TYPE_AGGREGATOR_PAD);
  set_metadata(klass, "AEDAT 4 muxer", "Codec/Muxer",
               "Writes events and frames into AEDAT 4 files");
  set_output_extensions(element_class, "application/x-aedat");

  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  aggregator_class->aggregate = aggregate;
  aggregator_class->get_next_time = get_next_time;
  aggregator_class->sink_event_pre_queue = sink_event_pre_queue;
  aggregator_class->sink_event = sink_event;
  aggregator_class->src_event = src_event;
  aggregator_class->src_query = src_query;
  aggregator_class->create_new_pad = create_new_pad;
  aggregator_class->start = start;
  aggregator_class->stop = stop;
  aggregator_class->flush = flush;
  aggregator_class->negotiate = nullptr;  // send_caps() sets the caps
}
