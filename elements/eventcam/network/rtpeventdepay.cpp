// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-rtpeventdepay
 * @title: rtpeventdepay
 * @short_description: receives events in RTP packets
 *
 * Extracts the events from the RTP packets of rtpeventpay; docs/rtp-payload-format.md specifies
 * them. The caps need `width` and `height` of the sensor, as integers or as strings from SDP, and
 * `format` unless it is EVT3. Put rtpjitterbuffer or rtpbin upstream: packets that arrive out of
 * order are dropped.
 *
 * Buffers have the sender's PTS and duration, and an interval without events is a GAP event. The
 * segment maps the sender's times to the running time at which they arrive: it is updated when this
 * mapping drifts by more than 5 ms, and when the sender restarts. Event times never change, so
 * recordings of several receivers agree.
 *
 * After a loss, the buffer with the remaining events, or else the next one, is flagged DISCONT; so
 * is the one after a dropped packet whose number or SSRC was unexpected. An invalid packet is
 * dropped as a whole. `max-reorder` is 0, so that this element counts late packets.
 *
 * A new SSRC is followed at once: the sender restarted. If packets of the SSRC before it still
 * arrive, there are two senders: the new one is rejected, with a warning, until the other has been
 * silent for a second.
 *
 * #GstRtpEventDepay:stats has the fields of #GstRTPBaseDepayload, and these, all #guint64:
 *
 * - `packets`, `bytes`: packets received, and the size of their payloads;
 * - `events`: events received;
 * - `lost-packets`, `lost-events`: sent after the first packet, but did not arrive in time;
 * - `late-packets`: duplicates, and packets that arrived out of order; dropped;
 * - `rejected-packets`: packets that are not of this format, sensor or sender, or corrupt.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 udpsrc port=5000
 * caps="application/x-rtp,media=application,clock-rate=1000000,encoding-name=X-EVENT-CAMERA,width=640,height=480"
 * ! rtpjitterbuffer ! rtpeventdepay ! eventrender ! videoconvert ! autovideosink
 * gst-launch-1.0 v4l2src ! videoscale ! video/x-raw,width=640,height=480 ! eventsim-dvs !
 * rtpeventpay ! udpsink host=receiver port=5000
 * ]|
 *
 * Since: 0.1
 */
#include <gst/rtp/gstrtpbasedepayload.h>
#include <gst/rtp/gstrtpbuffer.h>

#include <charconv>
#include <string_view>

#include "elements/eventcam/network/reception_reports.hpp"
#include "elements/eventcam/network/rtp_events.hpp"
#include "gst/base/arrival_segment.hpp"
#include "gst/base/buffer_bytes.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/pads.hpp"
#include "src/wire/rtp_unpacker.hpp"

GST_DEBUG_CATEGORY_STATIC(rtp_event_depay_debug);
#define GST_CAT_DEFAULT rtp_event_depay_debug

using namespace eventcamera;

namespace {

/// Maximum drift of the mapping from the sender's times to running time.
constexpr GstClockTimeDiff max_drift = 5 * GST_MSECOND;

/// Stream of a sender.
struct State {
  State(SensorSize size, RtpEventFormat events_format)
      : sensor(size), format(events_format), unpacker(size, format) {}

  /// Sequence numbers and counters continue.
  void change(SensorSize size, RtpEventFormat events_format) {
    unpacker.change(size, events_format);
    sensor = size;
    format = events_format;
  }

  SensorSize sensor;
  RtpEventFormat format;
  RtpUnpacker unpacker;
  ArrivalSegment segment{max_drift};
  bool is_discontinuous = false;  ///< before the next buffer
};

/// State from start to stop.
struct Stream {
  std::optional<State> state;
  guint32 segment_seqnum = gst_util_seqnum_next();  ///< of upstream
  WarnOnce warn_of_second_sender{GST_CAT_DEFAULT};
  WarnOnce warn_of_rejected{GST_CAT_DEFAULT};
  RepeatLevel late_level;
};

struct Private {
  explicit Private(GstRTPBaseDepayload* of)
      : element(of), stream(GST_RTP_BASE_DEPAYLOAD_SINKPAD(of)) {}

  GstRTPBaseDepayload* const element;
  StreamLocked<Stream> stream;
  Guarded<RtpStatistics> statistics;
  ReceptionReports reports;
};

}  // namespace

DEFINE_EVENT_ELEMENT(GstRtpEventDepay, gst_rtp_event_depay, RTP_EVENT_DEPAY, GstRTPBaseDepayload,
                     GST_TYPE_RTP_BASE_DEPAYLOAD, rtpeventdepay, GST_RANK_SECONDARY,
                     "RTP depayloader of events")
#define PARENT_DEPAYLOAD_CLASS GST_RTP_BASE_DEPAYLOAD_CLASS(gst_rtp_event_depay_parent_class)

/// Maps the sender's time `start` to the running time of its packet, unless the segment already
/// does.
static void update_segment(Private& self, GstClockTime start, GstClockTime arrival) {
  const GstSegment& in = self.element->segment;
  if (in.format != GST_FORMAT_TIME) arrival = GST_CLOCK_TIME_NONE;
  const guint64 running = gst_segment_to_running_time(&in, in.format, arrival);
  auto& segment = self.stream->state->segment;
  if (segment.continues(start, running)) return;
  GST_DEBUG_OBJECT(self.element,
                   "the sender's %" GST_TIME_FORMAT " arrives at running time %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(start), GST_TIME_ARGS(running));
  segment.begin(GST_RTP_BASE_DEPAYLOAD_SRCPAD(self.element), self.stream->segment_seqnum, start,
                running, gst_segment_to_stream_time(&in, in.format, arrival));
}

static const Report no_memory{GST_RESOURCE_ERROR_NO_SPACE_LEFT,
                              "Not enough memory to receive events."};

static void push(Private& self, const RtpInterval& interval) {
  const auto start = static_cast<GstClockTime>(interval.start);
  const auto duration = static_cast<GstClockTime>(interval.duration);
  update_segment(self, start, interval.arrival);
  auto& state = *self.stream->state;
  state.segment.extend_to(start + duration);
  state.is_discontinuous |= interval.is_discontinuous;
  GST_LOG_OBJECT(self.element,
                 "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT " for %" GST_TIME_FORMAT "%s",
                 interval.events.size(), GST_TIME_ARGS(start), GST_TIME_ARGS(duration),
                 interval.is_discontinuous ? ", after a loss" : "");
  if (interval.events.empty()) {
    gst_pad_push_event(GST_RTP_BASE_DEPAYLOAD_SRCPAD(self.element),
                       gst_event_new_gap(start, duration));
    return;
  }
  GstBuffer* buffer = copied_buffer(std::as_bytes(interval.events));
  stamp(buffer, {start, start + duration}, state.is_discontinuous);
  GST_BUFFER_DTS(buffer) = start;  // else the base class sets the packet's, in receiver time
  gst_rtp_base_depayload_push(self.element, buffer);
}

static void flush(Private& self) {
  catch_exceptions(self.element, no_memory, [&] {
    if (auto& state = self.stream->state)
      state->unpacker.flush([&](const RtpInterval& interval) { push(self, interval); });
  });
}

static RtpPacket packet_of(GstRTPBuffer* rtp) {
  return {
      .ssrc = gst_rtp_buffer_get_ssrc(rtp),
      .sequence_number = gst_rtp_buffer_get_seq(rtp),
      .marker = gst_rtp_buffer_get_marker(rtp) != FALSE,
      .payload = {static_cast<const std::uint8_t*>(gst_rtp_buffer_get_payload(rtp)),
                  gst_rtp_buffer_get_payload_len(rtp)},
      .arrival = GST_BUFFER_PTS(rtp->buffer),
  };
}

/// Publishes the statistics after packet `number`, and logs how it changed them.
static void update_statistics(Private& self, guint number) {
  const auto& counted = self.stream->state->unpacker.statistics();
  const auto before = std::exchange(*self.statistics.lock(), counted);
  if (const guint64 lost = counted.lost_packets - before.lost_packets; lost > 0) {
    GST_DEBUG_OBJECT(self.element, "lost %" G_GUINT64_FORMAT " packets before number %u", lost,
                     number);
    self.reports.packets_lost(GST_ELEMENT(self.element), lost);
  }
  if (counted.second_sender_packets > before.second_sender_packets)
    self.stream->warn_of_second_sender(
        self.element,
        {GST_RESOURCE_ERROR_BUSY,
         "Rejected the packets of a second sender; stats counts them. Let each sender use a port "
         "of its own, or separate them by rtpssrcdemux or rtpbin."},
        "packet number " + std::to_string(number) + " has an SSRC beside the current one");
  else if (counted.rejected_packets > before.rejected_packets)
    self.stream->warn_of_rejected(
        self.element,
        {GST_STREAM_ERROR_DECODE,
         "Rejected a packet: it is corrupt, or of another sensor or format. Set width, height and "
         "format in the caps to match the sender; stats counts the rejected packets."},
        "packet number " + std::to_string(number));
  if (counted.late_packets > before.late_packets)
    GST_CAT_LEVEL_LOG(GST_CAT_DEFAULT, self.stream->late_level.next(), self.element,
                      "dropped packet number %u: later ones arrived before it, or it came twice",
                      number);
}

static GstBuffer* process_packet(GstRTPBaseDepayload* depayload, GstRTPBuffer* rtp) {
  auto& self = priv_of(depayload);
  const auto packet = packet_of(rtp);
  self.reports.packet_arrived();
  auto& unpacker = self.stream->state->unpacker;
  catch_exceptions(self.element, no_memory, [&] {
    unpacker.push(packet, [&](const RtpInterval& interval) { push(self, interval); });
  });
  update_statistics(self, packet.sequence_number);
  return nullptr;
}

static gboolean handle_event(GstRTPBaseDepayload* depayload, GstEvent* event) {
  auto& self = priv_of(depayload);
  auto& state = self.stream->state;
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_GAP:  // its times are not the sender's
      gst_event_unref(event);
      return TRUE;
    case GST_EVENT_FLUSH_STOP:
      GST_DEBUG_OBJECT(self.element, "flushed: the next packet begins a stream");
      if (state) {
        state->unpacker.reset();
        state->segment.reset();
      }
      break;
    case GST_EVENT_EOS:
      GST_DEBUG_OBJECT(self.element, "the stream ends");
      flush(self);
      break;
    case GST_EVENT_SEGMENT:
      flush(self);
      if (!plays_forwards(self.element, event, "receive")) return FALSE;
      self.stream->segment_seqnum = gst_event_get_seqnum(event);
      break;
    default:
      break;
  }
  const gboolean handled = PARENT_DEPAYLOAD_CLASS->handle_event(depayload, event);
  depayload->need_newsegment = FALSE;  // the base class would push one in receiver time
  return handled;
}

/// Does nothing, because later packets reveal losses. The default would send a GAP event, with
/// times that are not the sender's.
static gboolean packet_lost(GstRTPBaseDepayload*, GstEvent*) {
  return TRUE;
}

/// Value of a parameter, an integer or a string from SDP, within 1 ... max_side.
static std::optional<int> side_of(const GstStructure* caps, const char* name) {
  int side = 0;
  if (const auto* text = gst_structure_get_string(caps, name)) {
    const std::string_view digits = text;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), side);
    if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  } else if (gst_structure_get_int(caps, name, &side) == FALSE) {
    return std::nullopt;
  }
  return is_side(side) ? std::optional(side) : std::nullopt;
}

static std::optional<RtpEventFormat> format_of(const GstStructure* caps) {
  if (!gst_structure_has_field(caps, "format")) return RtpEventFormat::evt3;
  const auto* name = gst_structure_get_string(caps, "format");
  for (std::size_t i = 0; i < rtp_event_formats.size(); ++i)
    if (g_strcmp0(name, rtp_event_formats[i]) == 0) return static_cast<RtpEventFormat>(i);
  return std::nullopt;
}

static gboolean set_caps(GstRTPBaseDepayload* depayload, GstCaps* caps) {
  auto& self = priv_of(depayload);
  auto& state = self.stream->state;
  depayload->clock_rate = rtp_clock_rate;
  const auto* structure = gst_caps_get_structure(caps, 0);
  const auto width = side_of(structure, "width");
  const auto height = side_of(structure, "height");
  const auto format = format_of(structure);
  if (!width || !height || !format) {
    gchar* cause = gst_caps_to_string(caps);
    post_message(self.element, GST_MESSAGE_ERROR,
                 {GST_STREAM_ERROR_FORMAT,
                  "Cannot receive events without the size of the sensor, or in another format than "
                  "EVT3 and XYTP; set width, height and format in the RTP caps, for example on "
                  "udpsrc, to match the sender."},
                 cause);
    g_free(cause);
    return FALSE;
  }
  const SensorSize sensor{*width, *height};
  if (state && state->sensor == sensor && state->format == *format) return TRUE;
  flush(self);
  GST_DEBUG_OBJECT(self.element, "receiving the events of %dx%d pixels as %s", sensor.width,
                   sensor.height, rtp_event_formats[static_cast<std::size_t>(*format)]);
  const bool follows = catch_exceptions(self.element, no_memory, [&] {
    if (state)
      state->change(sensor, *format);
    else
      state.emplace(sensor, *format);
  });
  if (!follows) return FALSE;
  return gst_pad_set_caps(GST_RTP_BASE_DEPAYLOAD_SRCPAD(self.element), event_caps(sensor).get());
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  auto& self = priv_of(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) *self.statistics.lock() = {};
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_rtp_event_depay_parent_class)->change_state(element, transition);
  self.reports.follow(transition, GST_RTP_BASE_DEPAYLOAD_SINKPAD(element));
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) self.stream.reset();
  return result;
}

static GstStructure* stats_of(GObject* object) {
  GstStructure* stats = base_rtp_stats(object, GST_TYPE_RTP_BASE_DEPAYLOAD);
  const auto counted = *priv_of(object).statistics.lock();
  gst_structure_set(
      stats, "packets", G_TYPE_UINT64, guint64{counted.packets}, "bytes", G_TYPE_UINT64,
      guint64{counted.bytes}, "events", G_TYPE_UINT64, guint64{counted.events}, "lost-packets",
      G_TYPE_UINT64, guint64{counted.lost_packets}, "lost-events", G_TYPE_UINT64,
      guint64{counted.lost_events}, "late-packets", G_TYPE_UINT64, guint64{counted.late_packets},
      "rejected-packets", G_TYPE_UINT64, guint64{counted.rejected_packets}, nullptr);
  return stats;
}

static void gst_rtp_event_depay_init(GstRtpEventDepay* self) {
  self->priv = new Private(GST_RTP_BASE_DEPAYLOAD(self));
  // Otherwise gst_rtp_base_depayload_handle_buffer() drops late packets uncounted, and those that
  // follow an invalid number ahead of theirs.
  g_object_set(self, "max-reorder", 0, nullptr);
}

static void gst_rtp_event_depay_class_init(GstRtpEventDepayClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;
  install_stats(object_class, stats_of, "Counters of packets and events received and lost");

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  add_pad_templates(element_class, RTP_EVENT_CAPS, EVENT_CAPS);
  set_metadata(klass, "RTP event depayloader", "Codec/Depayloader/Network/RTP",
               "Extracts events from RTP packets");
  element_class->change_state = change_state;

  GstRTPBaseDepayloadClass* depayload_class = GST_RTP_BASE_DEPAYLOAD_CLASS(klass);
  depayload_class->set_caps = set_caps;
  depayload_class->process_rtp_packet = process_packet;
  depayload_class->handle_event = handle_event;
  depayload_class->packet_lost = packet_lost;
}
