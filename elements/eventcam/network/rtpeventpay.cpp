// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-rtpeventpay
 * @title: rtpeventpay
 * @short_description: sends events in RTP packets
 *
 * Packs events into RTP packets of at most #GstRTPBasePayload:mtu bytes, in the payload format of
 * docs/rtp-payload-format.md. Each packet can be decoded by itself. A buffer of events is sent at
 * once; short ones are joined for at most #GstRtpEventPay:max-latency to fill packets. A GAP event
 * becomes a packet without events, so that receivers know that there are none.
 *
 * Events outside the sensor or their buffer's interval, or earlier than the previous event, are
 * dropped with a warning.
 *
 * #GstRtpEventPay:stats has the fields of #GstRTPBasePayload, and these:
 *
 * - `packets`, `bytes` (#guint64): packets sent, and the size of their payloads;
 * - `events` (#guint64): events sent;
 * - `rejected-events` (#guint64): events dropped as above, by a flush, or with an invalid
 *   buffer: no PTS, a PTS of more than 292 years, or a partial event.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 v4l2src ! eventsim-dvs ! rtpeventpay ! udpsink host=receiver port=5000
 * ]|
 *
 * Since: 0.1
 */
#include <gst/rtp/gstrtpbasepayload.h>
#include <gst/rtp/gstrtpbuffer.h>
#include <gst/rtp/gstrtphdrext.h>

#include <string_view>

#include "elements/eventcam/network/flush_timer.hpp"
#include "elements/eventcam/network/rtp_events.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/pads.hpp"
#include "gst/recording/sensor_events.hpp"
#include "src/wire/rtp_packer.hpp"

GST_DEBUG_CATEGORY_STATIC(rtp_event_pay_debug);
#define GST_CAT_DEFAULT rtp_event_pay_debug

using namespace eventcamera;

namespace {

/// Size of the RTP header extensions that a payloader with given caps writes in each packet.
/// GstRTPBasePayload keeps its extensions private (header_exts), so other instances of them are
/// asked.
class RtpHeaderExtensions {
 public:
  /// Maximum size in bytes, with the extensions' common header.
  gsize max_size(const OwnedCaps& caps) {
    if (caps.get() != caps_.get()) {
      size_ = size_of(*gst_caps_get_structure(caps.get(), 0));
      caps_.reset(gst_caps_ref(caps.get()));
    }
    return size_;
  }

 private:
  /// RFC 8285: maximum identifier and size of elements with a one-byte header, and maximum size of
  /// elements with a two-byte header.
  static constexpr guint max_short_id = 14;
  static constexpr gsize max_short_size = 16;
  static constexpr gsize max_long_size = 255;

  static const char* uri_of(const GValue* extmap) {
    if (GST_VALUE_HOLDS_ARRAY(extmap) && gst_value_array_get_size(extmap) > 1)
      extmap = gst_value_array_get_value(extmap, 1);
    return G_VALUE_HOLDS_STRING(extmap) ? g_value_get_string(extmap) : nullptr;
  }

  static gsize size_of(const GstStructure& caps) {
    const OwnedBuffer any(gst_buffer_new());  // extensions may inspect the buffer
    gsize count = 0;
    gsize size = 0;
    bool is_short = true;
    for (gint i = 0; i < gst_structure_n_fields(&caps); ++i) {
      constexpr std::string_view prefix = "extmap-";
      const char* const name = gst_structure_nth_field_name(&caps, static_cast<guint>(i));
      if (!std::string_view(name).starts_with(prefix)) continue;
      const auto id = static_cast<guint>(g_ascii_strtoull(name + prefix.size(), nullptr, 10));
      const char* const uri = uri_of(gst_structure_get_value(&caps, name));
      const std::unique_ptr<GstRTPHeaderExtension, UnrefObject> extension(
          uri != nullptr ? gst_rtp_header_extension_create_from_uri(uri) : nullptr);
      // An application may use an extension that is not registered.
      gsize largest = id <= max_short_id ? max_short_size : max_long_size;
      if (extension) {
        gst_rtp_header_extension_set_id(extension.get(), id);
        largest = gst_rtp_header_extension_get_max_size(extension.get(), any.get());
        is_short &= (gst_rtp_header_extension_get_supported_flags(extension.get()) &
                     GST_RTP_HEADER_EXTENSION_ONE_BYTE) != 0;
      }
      is_short &= id <= max_short_id && largest <= max_short_size;
      size += largest;
      ++count;
    }
    if (count == 0) return 0;
    constexpr gsize header_size = 4;
    constexpr gsize word = 4;
    return header_size + (size + count * (is_short ? 1 : 2) + word - 1) / word * word;
  }

  OwnedCaps caps_;  ///< caps to which the size applies
  gsize size_ = 0;
};

struct Settings : PayloaderSettings {
  RtpEventFormat format = RtpEventFormat::evt3;
};

struct State {
  State(SensorSize size, RtpEventFormat events_format, std::uint32_t first_event)
      : sensor(size), format(events_format), packer(size, format, first_event), pending(size) {}

  SensorSize sensor;
  RtpEventFormat format;
  RtpPacker packer;
  PendingInterval pending;
};

struct Sent {
  std::uint64_t packets = 0;
  std::uint64_t bytes = 0;
  std::uint64_t events = 0;
  std::uint64_t rejected = 0;
};

/// State from start to stop.
struct Stream {
  std::optional<State> state;
  EventFaults faults{"send", GST_CAT_DEFAULT};
  GstFlowReturn flow = GST_FLOW_OK;  ///< result of the last packets
  guint8 csrc_count = 0;             ///< of the packets sent for the last buffer; others have none
  RtpHeaderExtensions extensions;
};

struct Private {
  explicit Private(GstRTPBasePayload* of) : element(of), stream(GST_RTP_BASE_PAYLOAD_SINKPAD(of)) {}

  GstRTPBasePayload* const element;
  Guarded<Settings> settings;
  Guarded<Sent> sent;
  StreamLocked<Stream> stream;
  FlushTimer timer;
};

}  // namespace

DEFINE_EVENT_ELEMENT(GstRtpEventPay, gst_rtp_event_pay, RTP_EVENT_PAY, GstRTPBasePayload,
                     GST_TYPE_RTP_BASE_PAYLOAD, rtpeventpay, GST_RANK_SECONDARY,
                     "RTP payloader of events")
#define PARENT_PAYLOAD_CLASS GST_RTP_BASE_PAYLOAD_CLASS(gst_rtp_event_pay_parent_class)

/// Maximum size of the RTP header, with the CSRCs and header extensions that the base class writes.
static gsize max_header_size(Private& self) {
  const OwnedCaps caps(gst_pad_get_current_caps(GST_RTP_BASE_PAYLOAD_SRCPAD(self.element)));
  return gst_rtp_buffer_calc_header_len(self.stream->csrc_count) +
         (caps ? self.stream->extensions.max_size(caps) : 0);
}

static gsize max_payload_size(Private& self) {
  const gsize header = max_header_size(self);
  return std::max<gsize>(GST_RTP_BASE_PAYLOAD_MTU(self.element), header) - header;
}

static GstBuffer* make_packet(Private& self, std::span<const std::uint8_t> payload, bool is_last,
                              GstClockTime pts) {
  GstBuffer* packet = gst_rtp_base_payload_allocate_output_buffer(
      self.element, static_cast<guint>(payload.size()), 0, 0);
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  gst_rtp_buffer_map(packet, GST_MAP_WRITE, &rtp);
  std::ranges::copy(payload, static_cast<std::uint8_t*>(gst_rtp_buffer_get_payload(&rtp)));
  gst_rtp_buffer_set_marker(&rtp, is_last ? TRUE : FALSE);
  gst_rtp_buffer_unmap(&rtp);
  GST_BUFFER_PTS(packet) = pts;
  return packet;
}

static void send(Private& self) {
  if (!self.stream->state || self.stream->state->pending.empty()) return;
  auto& pending = self.stream->state->pending;
  Sent sent;
  std::unique_ptr<GstBufferList, Unref> list(gst_buffer_list_new());
  self.stream->state->packer.pack(
      pending.start(), pending.end() - pending.start(), pending.events(), max_payload_size(self),
      [&](std::span<const std::uint8_t> payload, bool is_last) {
        gst_buffer_list_add(list.get(), make_packet(self, payload, is_last,
                                                    static_cast<GstClockTime>(pending.start())));
        ++sent.packets;
        sent.bytes += payload.size();
      });
  sent.events = pending.events().size();
  GST_LOG_OBJECT(self.element,
                 "%" G_GUINT64_FORMAT " events from %" GST_TIME_FORMAT " to %" GST_TIME_FORMAT
                 " in %" G_GUINT64_FORMAT " packets",
                 guint64{sent.events}, GST_TIME_ARGS(static_cast<GstClockTime>(pending.start())),
                 GST_TIME_ARGS(static_cast<GstClockTime>(pending.end())), guint64{sent.packets});
  pending.clear();
  self.timer.cancel();
  {
    const auto total = self.sent.lock();
    total->packets += sent.packets;
    total->bytes += sent.bytes;
    total->events += sent.events;
  }
  const GstFlowReturn flow = gst_rtp_base_payload_push_list(self.element, list.release());
  if (self.stream->flow == GST_FLOW_OK) self.stream->flow = flow;
}

/// Runs `work`, which may throw, and returns the result of the packets that it sent.
template <class Work>
static GstFlowReturn reported(Private& self, const Work& work) {
  self.stream->flow = GST_FLOW_OK;
  const auto failure = [&](const std::exception& error) -> Report {
    if (is_a<std::invalid_argument>(error))
      return {GST_STREAM_ERROR_FORMAT,
              "An RTP packet of " + std::to_string(GST_RTP_BASE_PAYLOAD_MTU(self.element)) +
                  " bytes has no space for events; set mtu to at least " +
                  std::to_string(RtpPacker::min_size + max_header_size(self)) + "."};
    return {GST_RESOURCE_ERROR_NO_SPACE_LEFT, "Not enough memory to send the events."};
  };
  if (!catch_exceptions(self.element, failure, work)) return GST_FLOW_ERROR;
  return self.stream->flow;
}

/// Sends events that have waited for max-latency.
static void send_late(GstObject* element) {
  auto& self = priv_of(element);
  GST_LOG_OBJECT(self.element, "max-latency elapsed: sending an incomplete packet");
  reported(self, [&] { send(self); });
}

/// True if the pending events fill a packet, or cannot wait for another interval as long as the
/// last one.
static bool is_due(Private& self, Nanoseconds last_duration) {
  const auto& [sensor, format, packer, pending] = *self.stream->state;
  const std::size_t event_size = format == RtpEventFormat::evt3 ? 4 : sizeof(Event);
  const auto waiting = static_cast<GstClockTime>(pending.end() - pending.start() + last_duration);
  return pending.events().size() * event_size >= max_payload_size(self) ||
         waiting >= self.settings.copy().max_latency;
}

/// Adds an interval, and sends the pending events if they are due. Returns the events that cannot
/// be sent.
static InvalidEvents add_interval(Private& self, EventInterval interval,
                                  std::span<const Event> events) {
  auto& pending = self.stream->state->pending;
  const auto start = static_cast<Nanoseconds>(interval.start);
  const auto end = static_cast<Nanoseconds>(interval.end);
  if (!pending.empty() && pending.end() != start) send(self);
  const bool is_first = pending.empty();
  const auto rejected = pending.add(start, end, events, [&] { send(self); });
  if (is_due(self, end - start)) {
    send(self);
  } else if (is_first) {
    self.timer.set(self.settings.copy().max_latency, GST_RTP_BASE_PAYLOAD_SINKPAD(self.element),
                   send_late);
  }
  return rejected;
}

static GstFlowReturn handle_buffer(GstRTPBasePayload* payload, GstBuffer* received) {
  auto& self = priv_of(payload);
  const OwnedBuffer buffer(received);
  if (!self.stream->state) return GST_FLOW_NOT_NEGOTIATED;
  constexpr guint max_csrc_count = 15;
  self.stream->csrc_count = static_cast<guint8>(
      std::min(gst_rtp_base_payload_get_source_count(payload, received), max_csrc_count));
  const MappedEvents mapped(received);
  if (!mapped || mapped.interval().start > static_cast<GstClockTime>(max_rtp_start)) {
    self.stream->faults.warn(self.element, event_fault(received), received);
    self.sent.lock()->rejected += gst_buffer_get_size(received) / sizeof(Event);
    return GST_FLOW_OK;
  }
  GST_LOG_OBJECT(self.element, "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT,
                 mapped.events().size(), GST_TIME_ARGS(mapped.interval().start));
  return reported(self, [&] {
    const auto rejected = add_interval(self, mapped.interval(), mapped.events());
    self.sent.lock()->rejected += rejected.outside + rejected.unsorted;
    self.stream->faults.warn(self.element, rejected, received);
  });
}

/// Sends a GAP event as an interval without events; at once if its duration is unknown.
static void handle_gap(Private& self, GstEvent* event) {
  GstClockTime start = 0;
  GstClockTime duration = 0;
  gst_event_parse_gap(event, &start, &duration);
  if (!self.stream->state || start > static_cast<GstClockTime>(max_rtp_start)) return;
  const bool is_known = GST_CLOCK_TIME_IS_VALID(duration);
  const GstClockTime end =
      is_known ? start + std::min(duration, GstClockTime{max_interval}) : start;
  reported(self, [&] {
    add_interval(self, {start, end}, {});
    if (!is_known) send(self);
  });
}

static gboolean sink_event(GstRTPBasePayload* payload, GstEvent* event) {
  auto& self = priv_of(payload);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_GAP:
      handle_gap(self, event);
      gst_event_unref(event);
      return TRUE;
    case GST_EVENT_FLUSH_STOP:
      if (self.stream->state) {
        GST_DEBUG_OBJECT(self.element, "flushed: dropping %" G_GSIZE_FORMAT " events that wait",
                         self.stream->state->pending.events().size());
        self.sent.lock()->rejected += self.stream->state->pending.events().size();
        self.stream->state->pending.clear();
      }
      break;
    case GST_EVENT_SEGMENT:
      reported(self, [&] { send(self); });
      if (!plays_events(self.element, event, "send")) return FALSE;
      break;
    case GST_EVENT_EOS:
      GST_DEBUG_OBJECT(self.element, "the stream ends");
      [[fallthrough]];
    default:
      // Triggers and IMU samples precede each buffer, and may precede the interval that it joins.
      if (is_serialized(event) && !is_sensor_event(event)) reported(self, [&] { send(self); });
      break;
  }
  return PARENT_PAYLOAD_CLASS->sink_event(payload, event);
}

static GstClockTime latency_of(gpointer element) {
  return priv_of(element).settings.copy().max_latency;
}

static gboolean set_caps(GstRTPBasePayload* payload, GstCaps* caps) {
  auto& self = priv_of(payload);
  const auto sensor = sensor_of(caps);
  if (!sensor) return FALSE;
  const std::string width = std::to_string(sensor->width);
  const std::string height = std::to_string(sensor->height);
  auto& state = self.stream->state;
  if (!state || state->sensor != *sensor) {
    const auto first_event = state ? state->packer.next_event() : 0;
    const Report too_large{GST_STREAM_ERROR_FORMAT,
                           "EVT3 words support sensors of 1x1 to 2048x2048 pixels, not " + width +
                               "x" + height + "; set format=XYTP."};
    if (!catch_exceptions(self.element, too_large, [&] {
          state.emplace(*sensor, self.settings.copy().format, first_event);
        }))
      return FALSE;
  }
  const char* format_name = rtp_event_formats[static_cast<std::size_t>(state->format)];
  GST_DEBUG_OBJECT(self.element, "sending the events of %dx%d pixels as %s", sensor->width,
                   sensor->height, format_name);
  gst_rtp_base_payload_set_options(payload, "application", TRUE, "X-EVENT-CAMERA", rtp_clock_rate);
  return gst_rtp_base_payload_set_outcaps(payload, "width", G_TYPE_STRING, width.c_str(), "height",
                                          G_TYPE_STRING, height.c_str(), "format", G_TYPE_STRING,
                                          format_name, nullptr);
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  auto& self = priv_of(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) *self.sent.lock() = {};
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_rtp_event_pay_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    self.timer.stop();
    self.stream.reset();
  }
  return result;
}

static GstStructure* stats_of(GObject* object) {
  GstStructure* stats = base_rtp_stats(object, GST_TYPE_RTP_BASE_PAYLOAD);
  const auto sent = *priv_of(object).sent.lock();
  gst_structure_set(stats, "packets", G_TYPE_UINT64, guint64{sent.packets}, "bytes", G_TYPE_UINT64,
                    guint64{sent.bytes}, "events", G_TYPE_UINT64, guint64{sent.events},
                    "rejected-events", G_TYPE_UINT64, guint64{sent.rejected}, nullptr);
  return stats;
}

static void gst_rtp_event_pay_init(GstRtpEventPay* self) {
  self->priv = new Private(GST_RTP_BASE_PAYLOAD(self));
  answer_latency_queries<latency_of>(GST_RTP_BASE_PAYLOAD_SRCPAD(self));
  announce_max_latency(self);
}

static void gst_rtp_event_pay_class_init(GstRtpEventPayClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;

  Properties<field_of<&Private::settings>> properties(object_class);
  properties.add_fixed(
      &Settings::format, "format", "Format of the events in packets; read when the stream begins",
      enum_type<RtpEventFormat>(
          "GstRtpEventFormat",
          {{RtpEventFormat::evt3, "16-bit words, the most compact", "EVT3"},
           {RtpEventFormat::xytp, "8 bytes per event, for sensors of any size", "XYTP"}}));
  add_max_latency(properties);
  install_stats(object_class, stats_of, "Counters of packets and events sent");

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  add_pad_templates(element_class, EVENT_CAPS, RTP_EVENT_CAPS ", payload = (int) [ 96, 127 ]");
  set_metadata(klass, "RTP event payloader", "Codec/Payloader/Network/RTP",
               "Packs events into RTP packets");
  element_class->change_state = change_state;

  GstRTPBasePayloadClass* payload_class = GST_RTP_BASE_PAYLOAD_CLASS(klass);
  payload_class->set_caps = set_caps;
  payload_class->handle_buffer = handle_buffer;
  payload_class->sink_event = sink_event;
}
