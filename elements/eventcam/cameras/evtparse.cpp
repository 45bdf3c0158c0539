// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-evtparse
 * @title: evtparse
 * @short_description: finds the words of a live event camera
 *
 * Finds the EVT words of a live event camera for evtdec, in the padded GRAY8 buffers of Prophesee's
 * V4L2 drivers, or the bytes of a serial line or a socket. The sensor has the size
 * #GstEvtParse:width x #GstEvtParse:height and words of #GstEvtParse:format, unless the input's
 * caps state the format: their field `format` may be EVT2, EVT21, EVT3 or EVT4, or one of the
 * drivers' fourccs, PSEE (EVT2), PSE1 (EVT2.1 of the legacy byte order), PSE2 (EVT2.1) or PSE3
 * (EVT3).
 *
 * In a V4L2 buffer, words end at a marker, and the bytes past it are ignored. Other bytes may begin
 * anywhere; where some are missing, the next words are found by their times. Words are passed on
 * only if they are valid between two times that continue the camera's clock. All others are
 * counted as lost, and the next buffer is flagged DISCONT.
 *
 * A buffer's PTS is the camera's time, unwrapped, so that events keep their distances. The segment
 * maps it to running time: the camera's clock is read off the transfers that are least delayed, and
 * a new segment corrects the mapping when it is off by more than 1 ms. For clocks that drift apart
 * by up to 300 ppm, running times are within 2 ms of those transfers. Sources without timestamps,
 * such as filesrc, begin at running time 0, and the camera's clock alone gives the rest;
 * `do-timestamp=true` of tcpclientsrc adds them.
 *
 * An event waits in the camera until its transfer is complete. Live sinks wait for the longest of
 * the transfers so far, and at least for #GstEvtParse:latency.
 *
 * The device provider `eventcameraprovider` lists cameras with V4L2 drivers of Prophesee, and
 * creates v4l2src and evtparse for them; see docs/cameras.md.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 v4l2src device=/dev/video0 ! video/x-raw,format=GRAY8,width=4096,height=391 !
 * evtparse format=EVT3 width=320 height=320 ! evtdec ! eventrender ! videoconvert ! autovideosink
 * gst-launch-1.0 filesrc location=/dev/ttyACM0 blocksize=1024 ! evtparse format=EVT2 width=320
 * height=320 ! evtdec ! eventrender ! videoconvert ! autovideosink sync=false
 * gst-launch-1.0 tcpclientsrc host=camera port=3333 do-timestamp=true ! evtparse format=EVT3
 * width=1280 height=720 ! evtdec ! eventrender ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/video/video.h>

#include "elements/eventcam/cameras/event_camera.hpp"
#include "gst/base/arrival_segment.hpp"
#include "gst/base/buffer_bytes.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/properties.hpp"
#include "gst/recording/evt_caps.hpp"
#include "src/formats/chunker.hpp"
#include "src/formats/evt/word_scanner.hpp"
#include "src/wire/arrival_clock.hpp"

GST_DEBUG_CATEGORY_STATIC(evt_parse_debug);
#define GST_CAT_DEFAULT evt_parse_debug

using namespace eventcamera;

namespace {

/// Reads the transfers of a camera from its buffers: padded ones of a V4L2 driver, or loose bytes.
class CameraBuffers {
 public:
  struct Transfer {
    WordScanner::Transfer words;
    GstClockTime arrival;  ///< running time, if the buffer has a time
    guint64 lost;          ///< buffers that the driver dropped before this one
  };

  explicit CameraBuffers(Framing framing) : framing_(framing) {}

  /// Returns the transfer of a buffer of a segment, which holds `bytes`. Valid as long as these,
  /// and until the next call.
  Transfer transfer_of(GstBuffer* buffer, std::span<const guint8> bytes,
                       const GstSegment& segment) {
    const auto arrival = arrival_of(buffer, segment);
    const auto last = std::exchange(last_arrival_, arrival);
    const auto lost = lost_before(buffer, segment);
    Transfer transfer{.words = {.bytes = without_padding(buffer, bytes),
                                .is_discontinuous = GST_BUFFER_IS_DISCONT(buffer) || lost > 0,
                                .elapsed = {}},
                      .arrival = arrival,
                      .lost = lost};
    if (GST_CLOCK_TIME_IS_VALID(arrival) && GST_CLOCK_TIME_IS_VALID(last) && arrival >= last &&
        arrival - last <= max_gap)
      transfer.words.elapsed = microseconds(arrival - last);
    return transfer;
  }

 private:
  /// A camera that was silent for longer may have started over.
  static constexpr GstClockTime max_gap = GST_SECOND * 3600 * 24;

  static GstClockTime arrival_of(GstBuffer* buffer, const GstSegment& segment) {
    const auto pts = GST_BUFFER_PTS(buffer);
    // Sources of bytes stamp with running time.
    const auto arrival = segment.format == GST_FORMAT_TIME
                             ? gst_segment_to_running_time(&segment, GST_FORMAT_TIME, pts)
                             : pts;
    constexpr auto max = nanoseconds(Chunker::max_time);
    return arrival <= max ? arrival : GST_CLOCK_TIME_NONE;
  }

  /// Offsets of camera buffers are numbers; offsets of file buffers are in bytes.
  guint64 lost_before(GstBuffer* buffer, const GstSegment& segment) {
    if (framing_ != Framing::padded || segment.format != GST_FORMAT_TIME) return 0;
    const auto offset = GST_BUFFER_OFFSET(buffer);
    const auto last = std::exchange(last_offset_, offset);
    if (offset == GST_BUFFER_OFFSET_NONE || last == GST_BUFFER_OFFSET_NONE || offset <= last)
      return 0;
    return offset - last - 1;
  }

  /// The bytes of a buffer, without the padding of its rows.
  std::span<const guint8> without_padding(GstBuffer* buffer, std::span<const guint8> bytes) {
    const GstVideoMeta* const meta = gst_buffer_get_video_meta(buffer);
    if (meta == nullptr || meta->n_planes != 1 || meta->stride[0] <= static_cast<gint>(meta->width))
      return bytes;
    const auto stride = static_cast<gsize>(meta->stride[0]);
    rows_.clear();
    gsize at = meta->offset[0];
    for (guint y = 0; y < meta->height && at < bytes.size(); ++y, at += stride) {
      const auto row = bytes.subspan(at, std::min<gsize>(meta->width, bytes.size() - at));
      rows_.insert(rows_.end(), row.begin(), row.end());
    }
    return rows_;
  }

  Framing framing_;
  std::vector<guint8> rows_;
  GstClockTime last_arrival_ = GST_CLOCK_TIME_NONE;
  guint64 last_offset_ = GST_BUFFER_OFFSET_NONE;
};

constexpr int max_words_side = 2048;

constexpr int format_of_caps = -1;

struct Settings {
  int format = format_of_caps;
  int width = 0;
  int height = 0;
  GstClockTime latency = 10 * GST_MSECOND;
};

struct Input {
  std::optional<EvtFormat> format;
  SensorSize sensor;
  Framing framing = Framing::loose;
};

struct Stats {
  WordScanner::Counts words;
  guint64 buffers = 0;
  guint64 lost_buffers = 0;
  gint64 clock_offset = 0;
  double clock_drift = 0;
  guint64 clock_corrections = 0;
  GstClockTime max_transfer = 0;
};

void add(WordScanner::Counts& sum, const WordScanner::Counts& before,
         const WordScanner::Counts& after) {
  sum.bytes += after.bytes - before.bytes;
  sum.events += after.events - before.events;
  sum.lost_bytes += after.lost_bytes - before.lost_bytes;
  sum.lost_events += after.lost_events - before.lost_events;
  sum.gaps += after.gaps - before.gaps;
}

/// State of the stream, from its first buffer to stop.
struct State {
  CameraBuffers buffers;
  std::unique_ptr<WordScanner> scanner;
  std::vector<WordScanner::Piece> pieces{};
  ArrivalClock clock{};         ///< maps the camera's clock to running time
  ArrivalSegment segment{0};    ///< of the output
  bool is_segment_due = false;  ///< to correct the mapping

  /// Running time of a camera time; none before the first transfer.
  std::optional<Nanoseconds> running_time_of(GstClockTime time) const {
    const auto offset = clock.offset();
    return offset ? std::optional(static_cast<Nanoseconds>(time) + *offset) : std::nullopt;
  }
};

/// State from start to stop.
struct Stream {
  Stream() { gst_segment_init(&upstream, GST_FORMAT_UNDEFINED); }

  std::optional<Input> input;  ///< of the last caps
  GstSegment upstream;
  guint32 segment_seqnum = gst_util_seqnum_next();
  std::optional<State> state;
  WarnOnce warn_of_no_words{GST_CAT_DEFAULT};
  RepeatLevel loss_level;
};

struct Private : ElementPads {
  using ElementPads::ElementPads;

  Guarded<Settings> settings;
  Guarded<Stats> stats;
  StreamLocked<Stream> stream{sink};
};

}  // namespace

DEFINE_EVENT_ELEMENT(GstEvtParse, gst_evt_parse, EVT_PARSE, GstElement, GST_TYPE_ELEMENT, evtparse,
                     GST_RANK_NONE, "words of live event cameras")

static Input input_of(const GstCaps* caps) {
  const GstStructure* const structure = gst_caps_get_structure(caps, 0);
  const char* const format = gst_structure_get_string(structure, "format");
  if (gst_structure_has_name(structure, "video/x-raw") && g_strcmp0(format, "GRAY8") == 0)
    return {.format = {}, .sensor = {}, .framing = Framing::padded};
  const auto of_driver = words_of_fourcc(format != nullptr ? format : "");
  Input input{.format = of_driver ? of_driver : evt_format_named(format),
              .sensor = {},
              .framing = of_driver ? Framing::padded : Framing::loose};
  gst_structure_get_int(structure, "width", &input.sensor.width);
  gst_structure_get_int(structure, "height", &input.sensor.height);
  return input;
}

template <class Work>
static auto reported(Private& self, const Work& work) {
  return catch_exceptions(
      self.element, Report{GST_RESOURCE_ERROR_NO_SPACE_LEFT, "Not enough memory for the events."},
      work);
}

/// Begins a stream. False, after an error, if its words are unknown.
static bool start_stream(Private& self) {
  const auto settings = self.settings.copy();
  const auto input = self.stream->input.value_or(Input{});
  auto format = input.format;
  if (settings.format != format_of_caps) format = static_cast<EvtFormat>(settings.format);
  auto sensor = input.sensor;
  if (settings.width > 0 && settings.height > 0) sensor = {settings.width, settings.height};
  if (!format || sensor.width < 1 || sensor.height < 1 || sensor.width > max_words_side ||
      sensor.height > max_words_side) {
    post_message(self.element, GST_MESSAGE_ERROR,
                 {GST_RESOURCE_ERROR_SETTINGS,
                  "Cannot read this camera: its caps do not state the format of its words and the "
                  "size of its sensor. Set format, width and height."},
                 "format=" + std::to_string(settings.format) + ", " + in_pixels(sensor));
    return false;
  }
  return reported(self, [&] {
    self.stream->state.emplace(State{.buffers = CameraBuffers(input.framing),
                                     .scanner = make_word_scanner(*format, sensor, input.framing)});
    const OwnedCaps caps(gst_caps_new_simple(GST_EVENT_CAMERA_MEDIA_TYPE, "format", G_TYPE_STRING,
                                             evt_format_name(*format), "width", G_TYPE_INT,
                                             sensor.width, "height", G_TYPE_INT, sensor.height,
                                             "framerate", GST_TYPE_FRACTION, 0, 1, nullptr));
    GST_DEBUG_OBJECT(self.element, "reading %s as %" GST_PTR_FORMAT,
                     input.framing == Framing::padded ? "padded buffers" : "loose bytes",
                     caps.get());
    gst_pad_push_event(self.src, gst_event_new_caps(caps.get()));
  });
}

/// Pushes a segment before data of an interval, unless the last segment is still valid. Data before
/// running time 0, as in a first transfer, is late: the next data corrects the mapping.
static void begin_segment(Private& self, const EventInterval& interval) {
  auto& state = *self.stream->state;
  if (state.is_segment_due || !state.segment.continues(interval.start, GST_CLOCK_TIME_NONE)) {
    const bool is_correction = state.segment.has_begun();
    const auto running = state.running_time_of(interval.start);
    state.is_segment_due = running && *running < 0;
    const auto mapped =
        state.segment.begin(self.src, self.stream->segment_seqnum, interval.start,
                            running ? static_cast<GstClockTime>(std::max(*running, Nanoseconds{}))
                                    : GST_CLOCK_TIME_NONE,
                            interval.start);
    GST_DEBUG_OBJECT(self.element,
                     "the camera's %" GST_TIME_FORMAT " is running time %" GST_TIME_FORMAT,
                     GST_TIME_ARGS(interval.start), GST_TIME_ARGS(mapped));
    const auto stats = self.stats.lock();
    stats->clock_offset = GST_CLOCK_DIFF(interval.start, mapped);
    stats->clock_corrections += is_correction ? 1 : 0;
  }
  state.segment.extend_to(interval.end);
}

static GstFlowReturn push_pieces(Private& self) {
  auto& state = *self.stream->state;
  GstFlowReturn result = GST_FLOW_OK;
  for (auto& piece : state.pieces) {
    if (result != GST_FLOW_OK) break;
    const EventInterval interval{nanoseconds(piece.start), nanoseconds(piece.end)};
    begin_segment(self, interval);
    GST_LOG_OBJECT(self.element, "%" G_GSIZE_FORMAT " bytes of events at %" GST_TIME_FORMAT,
                   piece.words.size(), GST_TIME_ARGS(interval.start));
    GstBuffer* const buffer = owning_buffer(std::move(piece.words));
    stamp(buffer, interval, piece.is_discontinuous);
    result = gst_pad_push(self.src, buffer);
  }
  state.pieces.clear();
  return result;
}

static void note_losses(Private& self, const WordScanner::Counts& before, guint64 buffers) {
  constexpr guint64 max_skipped = 1U << 16;
  const auto& counts = self.stream->state->scanner->counts();
  if (buffers > 0 || counts.lost_bytes != before.lost_bytes)
    GST_CAT_LEVEL_LOG(GST_CAT_DEFAULT, self.stream->loss_level.next(), self.element,
                      "lost %" G_GUINT64_FORMAT " buffers, and %" G_GUINT64_FORMAT
                      " bytes with %" G_GUINT64_FORMAT " events",
                      buffers, guint64{counts.lost_bytes - before.lost_bytes},
                      guint64{counts.lost_events - before.lost_events});
  if (counts.lost_bytes > std::max<guint64>(counts.bytes, max_skipped))
    self.stream->warn_of_no_words(self.element,
                                  {GST_STREAM_ERROR_DECODE,
                                   "Most of the camera's data is not valid in this format. Set "
                                   "format, width and height to match the camera."},
                                  std::to_string(counts.lost_bytes) + " bytes are not valid");
}

/// Raises the latency to the duration of the longest transfer.
static void note_transfer(Private& self, GstClockTime arrival) {
  const auto& state = *self.stream->state;
  // The first transfer may hold older data from the camera's buffer.
  if (!state.segment.has_begun() || state.pieces.empty() || !GST_CLOCK_TIME_IS_VALID(arrival))
    return;
  const auto first = state.running_time_of(nanoseconds(state.pieces.front().start));
  if (!first) return;
  const auto length = std::clamp<gint64>(static_cast<gint64>(arrival) - *first, 0, GST_SECOND);
  const auto min_latency = self.settings.copy().latency;
  bool has_grown = false;
  {
    const auto stats = self.stats.lock();
    const auto transfer = static_cast<GstClockTime>(length);
    has_grown = transfer > std::max(min_latency, stats->max_transfer);
    // With a margin, so that the latency rarely changes.
    if (has_grown) stats->max_transfer = transfer + transfer / 8;
  }
  if (!has_grown) return;
  GST_DEBUG_OBJECT(self.element, "a transfer takes %" GST_TIME_FORMAT, GST_TIME_ARGS(length));
  post_latency(self.element);
}

static GstFlowReturn handle_transfer(Private& self, GstBuffer* buffer,
                                     std::span<const guint8> bytes) {
  auto& state = *self.stream->state;
  const auto before = state.scanner->counts();
  const auto transfer = state.buffers.transfer_of(buffer, bytes, self.stream->upstream);
  state.scanner->scan(transfer.words, state.pieces);
  if (!state.pieces.empty() && state.pieces.back().end > Chunker::max_time) {
    GST_ELEMENT_ERROR(self.element, STREAM, DECODE, ("The clock of the camera has jumped too far."),
                      ("it is at %" G_GINT64_FORMAT " us", state.pieces.back().end));
    return GST_FLOW_ERROR;
  }
  if (!state.pieces.empty() && GST_CLOCK_TIME_IS_VALID(transfer.arrival)) {
    // After a gap, the camera's clock may have been reset.
    const bool after_gap = std::ranges::any_of(state.pieces, &WordScanner::Piece::is_discontinuous);
    state.is_segment_due |= state.clock.arrive(
        state.pieces.back().end, static_cast<Nanoseconds>(transfer.arrival), after_gap);
  }
  {
    const auto stats = self.stats.lock();
    add(stats->words, before, state.scanner->counts());
    stats->clock_drift = state.clock.drift();
    ++stats->buffers;
    stats->lost_buffers += transfer.lost;
  }
  note_losses(self, before, transfer.lost);
  note_transfer(self, transfer.arrival);
  return push_pieces(self);
}

static GstFlowReturn chain(GstPad*, GstObject* parent, GstBuffer* received) {
  auto& self = priv_of(parent);
  const OwnedBuffer buffer(received);
  if (!self.stream->state && !start_stream(self)) return GST_FLOW_ERROR;
  const MappedBytes bytes(self.element, OwnedBuffer(gst_buffer_ref(received)));
  if (!bytes.is_mapped()) return GST_FLOW_ERROR;
  return reported(self, [&] { return handle_transfer(self, received, bytes.get()); });
}

/// Pushes the last words before the stream ends or changes.
static void end_stream(Private& self) {
  if (!self.stream->state) return;
  reported(self, [&] {
    auto& scanner = *self.stream->state->scanner;
    const auto before = scanner.counts();
    scanner.finish(self.stream->state->pieces);
    add(self.stats.lock()->words, before, scanner.counts());
    note_losses(self, before, 0);
    if (scanner.counts().events == 0 && self.stats.copy().buffers > 0)
      self.stream->warn_of_no_words(
          self.element,
          {GST_STREAM_ERROR_DECODE,
           "No events were found. If the camera sent some, set format, width and height to match "
           "it."},
          std::to_string(scanner.counts().lost_bytes) + " bytes are not valid");
    return push_pieces(self);
  });
}

static gboolean sink_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  auto& self = priv_of(parent);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_STREAM_START:
      end_stream(self);  // into the stream that ends here
      self.stream->state.reset();
      break;
    case GST_EVENT_CAPS:
      end_stream(self);
      self.stream->state.reset();
      self.stream->input = input_of(caps_of(event));
      gst_event_unref(event);
      return start_stream(self);
    case GST_EVENT_SEGMENT:
      if (!plays_forwards(self.element, event, "parse")) return FALSE;
      gst_event_copy_segment(event, &self.stream->upstream);
      self.stream->segment_seqnum = gst_event_get_seqnum(event);
      gst_event_unref(event);
      return TRUE;
    case GST_EVENT_GAP:
      gst_event_unref(event);  // the words of the camera have its times
      return TRUE;
    case GST_EVENT_EOS:
      end_stream(self);
      break;
    case GST_EVENT_FLUSH_STOP:
      self.stream->state.reset();
      break;
    default:
      break;
  }
  return gst_pad_event_default(pad, parent, event);
}

static GstClockTime latency_of(gpointer element) {
  return std::max(priv_of(element).settings.copy().latency,
                  priv_of(element).stats.copy().max_transfer);
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  auto& self = priv_of(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) *self.stats.lock() = {};
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_evt_parse_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) self.stream.reset();
  return result;
}

static void gst_evt_parse_init(GstEvtParse* self) {
  self->priv = new Private(GST_ELEMENT(self), chain, sink_event);
  answer_latency_queries<latency_of>(self->priv->src);
}

static GstStructure* structure_of(const Stats& stats) {
  return gst_structure_new(
      "application/x-event-parser-stats", "buffers", G_TYPE_UINT64, stats.buffers, "bytes",
      G_TYPE_UINT64, guint64{stats.words.bytes}, "events", G_TYPE_UINT64,
      guint64{stats.words.events}, "lost-buffers", G_TYPE_UINT64, stats.lost_buffers, "lost-bytes",
      G_TYPE_UINT64, guint64{stats.words.lost_bytes}, "lost-events", G_TYPE_UINT64,
      guint64{stats.words.lost_events}, "gaps", G_TYPE_UINT64, guint64{stats.words.gaps},
      "clock-offset", G_TYPE_INT64, stats.clock_offset, "clock-drift", G_TYPE_DOUBLE,
      stats.clock_drift, "clock-corrections", G_TYPE_UINT64, stats.clock_corrections, nullptr);
}

static void gst_evt_parse_class_init(GstEvtParseClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;

  Properties<field_of<&Private::settings>> properties(object_class);
  properties.add_fixed(
      &Settings::format, "format", "Format of the camera's words",
      enum_type<int>(
          "GstEvtParseFormat",
          {{format_of_caps, "As in the caps", "auto"},
           {static_cast<int>(EvtFormat::evt2), "32-bit words, one event each", "EVT2"},
           {static_cast<int>(EvtFormat::evt21), "64-bit words, up to 32 events each", "EVT21"},
           {static_cast<int>(EvtFormat::evt21_legacy), "EVT21 with the upper half first",
            "EVT21-legacy"},
           {static_cast<int>(EvtFormat::evt3), "16-bit words", "EVT3"},
           {static_cast<int>(EvtFormat::evt4), "32-bit words, vectors of events", "EVT4"}}));
  properties.add_fixed(&Settings::width, "width",
                       "Width of the sensor (pixels); 0 = as in the caps", 0, max_words_side);
  properties.add_fixed(&Settings::height, "height",
                       "Height of the sensor (pixels); 0 = as in the caps", 0, max_words_side);
  properties.add_fixed(
      &Settings::latency, "latency",
      "Minimum latency of live sinks, which rises to the duration of the longest transfer (ns)", 0,
      GST_SECOND);
  install_stats(
      object_class, [](GObject* object) { return structure_of(priv_of(object).stats.copy()); },
      "Counts since the start: buffers received; bytes and events passed on; lost-buffers, which "
      "the driver dropped; lost-bytes, which are not valid here, and lost-events in them; gaps in "
      "the output. The mapping of the camera's clock: clock-offset (int64, ns), running time minus "
      "the camera's; clock-drift (double, ppm), by which the camera's clock is slow; "
      "clock-corrections, the number of changes of the offset");

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = change_state;
  add_pad_templates(element_class, "ANY", EVT_WORDS_CAPS);
  set_metadata(klass, "EVT word parser", "Codec/Parser",
               "Finds the words of a live event camera in V4L2 buffers or loose bytes");
}
