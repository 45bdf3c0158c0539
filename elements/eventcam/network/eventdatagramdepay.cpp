// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventdatagramdepay
 * @title: eventdatagramdepay
 * @short_description: unpacks events from datagrams of other tools
 *
 * Unpacks events from datagrams of SpiNNaker, AEStream, EventCV, faery, Event Stream tools or jAER,
 * selected by #GstEventDatagramDepay:format. Each buffer is a datagram, as from udpsrc. Datagrams
 * do not contain the sensor size: set #GstEventDatagramDepay:width and
 * #GstEventDatagramDepay:height.
 *
 * A buffer's PTS is the sender's time, unwrapped. The segment maps it to the running time at which
 * the first event arrived, and changes if sender and receiver drift apart by more than a second, or
 * if the sender restarts. Events of SPIF without timestamps take the arrival time of their
 * datagram: the PTS of its buffer, which udpsrc sets.
 *
 * Live sinks wait for #GstEventDatagramDepay:latency, so that events which the sender or the
 * network delayed by up to this time are not late.
 *
 * A datagram that is malformed, or has an event outside the sensor, is rejected as a whole. One
 * that is older than an earlier one is dropped, so events are sorted. After a loss, which only the
 * sequence number of jAER reveals, the next buffer is flagged DISCONT.
 * #GstEventDatagramDepay:stats counts all of these; datagrams of a second sender count as rejected.
 *
 * jAER's addresses are read as a DVS128's if the sensor has 128x128 pixels, else as a
 * DAVIS's. Samples of frames and of the IMU are skipped.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 udpsrc port=3333 ! eventdatagramdepay format=spif width=640 height=480 !
 * eventrender ! videoconvert ! autovideosink
 * gst-launch-1.0 v4l2src ! videoscale ! video/x-raw,width=640,height=480 ! eventsim-dvs !
 * eventdatagrampay format=spif ! udpsink host=receiver port=3333
 * ]|
 *
 * Since: 0.1
 */
#include <gst/net/gstnetaddressmeta.h>

#include "elements/eventcam/network/datagram_properties.hpp"
#include "elements/eventcam/network/reception_reports.hpp"
#include "gst/base/arrival_segment.hpp"
#include "gst/base/buffer_bytes.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/pads.hpp"
#include "src/wire/datagrams.hpp"

GST_DEBUG_CATEGORY_STATIC(event_datagram_depay_debug);
#define GST_CAT_DEFAULT event_datagram_depay_debug

using namespace eventcamera;

namespace {

/// Follows the first of several senders until it has been silent for a second. Datagrams without an
/// address, which udpsrc adds, count as one sender's.
class CurrentSender {
 public:
  /// Whether a datagram that arrived at this running time may be from the current sender.
  bool may_have_sent(GstBuffer* datagram, GstClockTime arrival) const {
    const GstNetAddressMeta* meta = gst_buffer_get_net_address_meta(datagram);
    return meta == nullptr || !GST_CLOCK_TIME_IS_VALID(arrival) || !address_ || is_of(meta->addr) ||
           arrival >= last_ + max_silence;
  }

  /// Makes the sender of a valid datagram the current one.
  void follow(GstBuffer* datagram, GstClockTime arrival) {
    const GstNetAddressMeta* meta = gst_buffer_get_net_address_meta(datagram);
    if (meta == nullptr || !GST_CLOCK_TIME_IS_VALID(arrival)) return;
    if (!is_of(meta->addr)) address_.reset(G_SOCKET_ADDRESS(g_object_ref(meta->addr)));
    last_ = arrival;
  }

 private:
  static constexpr GstClockTime max_silence = GST_SECOND;

  bool is_of(GSocketAddress* address) const {
    if (!address_ || !G_IS_INET_SOCKET_ADDRESS(address)) return address_.get() == address;
    auto* const ours = G_INET_SOCKET_ADDRESS(address_.get());
    auto* const theirs = G_INET_SOCKET_ADDRESS(address);
    return g_inet_socket_address_get_port(ours) == g_inet_socket_address_get_port(theirs) &&
           g_inet_address_equal(g_inet_socket_address_get_address(ours),
                                g_inet_socket_address_get_address(theirs)) != FALSE;
  }

  std::unique_ptr<GSocketAddress, UnrefObject> address_;
  GstClockTime last_ = 0;  ///< arrival of its last datagram
};

/// Largest difference between the running time of an event and of its arrival.
constexpr GstClockTimeDiff max_drift = GST_SECOND;

/// Shorter gaps belong to the interval of the next buffer, longer ones are sent as a GAP event.
constexpr Microseconds min_gap = 1000;
static_assert(min_gap + max_datagram_span <= G_MAXUINT32, "wraps times in buffers");

/// State of the stream, from start to stop.
struct State {
  DatagramSettings settings;
  std::unique_ptr<DatagramUnpacker> unpacker;
  CurrentSender sender{};
  std::vector<AbsoluteEvent> events{};  ///< of the current datagram
  GstSegment upstream{};                ///< of arrival times
  guint32 segment_seqnum = gst_util_seqnum_next();
  ArrivalSegment segment{max_drift};
  Microseconds end = 0;           ///< of the last buffer
  bool is_discontinuous = false;  ///< before the next buffer
  bool has_caps = false;
};

struct Settings : DatagramSettings {
  GstClockTime latency = 10 * GST_MSECOND;
};

/// State from start to stop.
struct Stream {
  std::optional<State> state;
  WarnOnce warn_of_rejected{GST_CAT_DEFAULT};
  WarnOnce warn_of_second_sender{GST_CAT_DEFAULT};
  RepeatLevel late_level;
};

struct Private : ElementPads {
  using ElementPads::ElementPads;

  Guarded<Settings> settings;
  Guarded<DatagramCounts> counts;
  ReceptionReports reports;
  StreamLocked<Stream> stream{sink};
};

}  // namespace

DEFINE_EVENT_ELEMENT(GstEventDatagramDepay, gst_event_datagram_depay, EVENT_DATAGRAM_DEPAY,
                     GstElement, GST_TYPE_ELEMENT, eventdatagramdepay, GST_RANK_NONE,
                     "datagrams of events from other tools")

static bool push_caps(Private& self) {
  auto& state = *self.stream->state;
  if (state.has_caps) return true;
  const OwnedCaps caps = event_caps({state.settings.width, state.settings.height});
  GST_DEBUG_OBJECT(self.element, "the stream begins, with %" GST_PTR_FORMAT, caps.get());
  state.has_caps = gst_pad_push_event(self.src, gst_event_new_caps(caps.get())) != FALSE;
  return state.has_caps;
}

static GstFlowReturn push(Private& self, const Reception& reception, GstClockTime arrival) {
  auto& state = *self.stream->state;
  const auto first = state.events.front().t;
  if (!push_caps(self))
    return GST_PAD_IS_FLUSHING(self.src) ? GST_FLOW_FLUSHING : GST_FLOW_NOT_NEGOTIATED;
  if (reception.restarted || !state.segment.continues(nanoseconds(first), arrival)) {
    GST_DEBUG_OBJECT(self.element,
                     "the sender's %" GST_TIME_FORMAT " arrives at running time %" GST_TIME_FORMAT
                     "%s",
                     GST_TIME_ARGS(nanoseconds(first)), GST_TIME_ARGS(arrival),
                     reception.restarted ? ": the sender starts over" : "");
    state.segment.begin(self.src, state.segment_seqnum, nanoseconds(first), arrival,
                        nanoseconds(first));
    state.end = first;
    state.is_discontinuous = true;
  } else if (first - state.end > min_gap) {
    GstEvent* const gap =
        gst_event_new_gap(nanoseconds(state.end), nanoseconds(first - 1 - state.end));
    if (reception.lost > 0) gst_event_set_gap_flags(gap, GST_GAP_FLAG_MISSING_DATA);
    gst_pad_push_event(self.src, gap);
    state.end = first - 1;
  }
  std::vector<Event> events;
  events.reserve(state.events.size());
  for (const auto& event : state.events)
    events.push_back({static_cast<std::uint32_t>(event.t - state.end), event.x, event.y_p});
  const EventInterval interval{nanoseconds(state.end), nanoseconds(state.events.back().t)};
  state.end = state.events.back().t;
  GST_LOG_OBJECT(
      self.element, "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT " for %" GST_TIME_FORMAT,
      events.size(), GST_TIME_ARGS(interval.start), GST_TIME_ARGS(interval.end - interval.start));
  state.segment.extend_to(interval.end);
  GstBuffer* const buffer = copied_buffer(std::as_bytes(std::span(events)));
  stamp(buffer, interval, state.is_discontinuous);
  return gst_pad_push(self.src, buffer);
}

static void reject(Private& self, const char* fault, gsize size, GstClockTime arrival) {
  gchar* cause = g_strdup_printf("%" G_GSIZE_FORMAT " bytes at running time %" GST_TIME_FORMAT,
                                 size, GST_TIME_ARGS(arrival));
  self.stream->warn_of_rejected(
      self.element,
      {GST_STREAM_ERROR_DECODE, std::string("Rejected a datagram: ") + fault +
                                    ". Set format, width and height to match the sender; stats "
                                    "counts the rejected datagrams."},
      cause);
  g_free(cause);
}

/// Counts a datagram of another sender, whose clock and sensor differ.
static void reject_second_sender(Private& self, GstClockTime arrival) {
  ++self.counts.lock()->rejected;
  gchar* cause =
      g_strdup_printf("a datagram at running time %" GST_TIME_FORMAT " is from another address",
                      GST_TIME_ARGS(arrival));
  self.stream->warn_of_second_sender(
      self.element,
      {GST_RESOURCE_ERROR_BUSY,
       "Rejected the datagrams of a second sender, until the first is silent for a second; stats "
       "counts them. Give each sender its own port."},
      cause);
  g_free(cause);
}

static GstFlowReturn receive(Private& self, GstBuffer* datagram,
                             std::span<const std::uint8_t> bytes, GstClockTime arrival) {
  auto& state = *self.stream->state;
  self.reports.packet_arrived();
  std::optional<Microseconds> time;
  if (GST_CLOCK_TIME_IS_VALID(arrival)) time = microseconds(arrival);
  const auto reception = state.unpacker->unpack(bytes, time, state.events);
  const bool accepted = reception.fault == nullptr && !reception.late;
  {
    const auto counts = self.counts.lock();
    counts->packets += accepted ? 1 : 0;
    counts->events += state.events.size();
    counts->bytes += accepted ? bytes.size() : 0;
    counts->lost += reception.lost;
    counts->late += reception.late ? 1 : 0;
    counts->rejected += reception.fault != nullptr ? 1 : 0;
  }
  if (reception.fault != nullptr)
    reject(self, reception.fault, bytes.size(), arrival);
  else
    state.sender.follow(datagram, arrival);
  if (reception.late)
    GST_CAT_LEVEL_LOG(GST_CAT_DEFAULT, self.stream->late_level.next(), self.element,
                      "dropped the datagram of running time %" GST_TIME_FORMAT
                      ": later events arrived before it",
                      GST_TIME_ARGS(arrival));
  if (reception.lost > 0) {
    GST_DEBUG_OBJECT(self.element,
                     "lost %" G_GUINT64_FORMAT
                     " datagrams before the one of running time %" GST_TIME_FORMAT,
                     guint64{reception.lost}, GST_TIME_ARGS(arrival));
    self.reports.packets_lost(self.element, reception.lost);
  }
  // A datagram without events, such as one with jAER's frame samples, may reveal a loss, too.
  state.is_discontinuous |= GST_BUFFER_IS_DISCONT(datagram) || reception.lost > 0;
  return state.events.empty() ? GST_FLOW_OK : push(self, reception, arrival);
}

static GstFlowReturn chain(GstPad*, GstObject* parent, GstBuffer* received) {
  auto& self = priv_of(parent);
  OwnedBuffer buffer(received);
  auto& state = self.stream->state;
  if (!state) return GST_FLOW_FLUSHING;
  const auto arrival = state->upstream.format != GST_FORMAT_TIME
                           ? GST_CLOCK_TIME_NONE
                           : gst_segment_to_running_time(&state->upstream, GST_FORMAT_TIME,
                                                         GST_BUFFER_PTS(received));
  if (!GST_CLOCK_TIME_IS_VALID(arrival) && state->settings.format == DatagramFormat::spif) {
    GST_ELEMENT_ERROR(self.element, STREAM, FORMAT,
                      ("SPIF events have no timestamps, and their datagrams no arrival time. Set "
                       "do-timestamp=true on the source, or format=spif-timestamps."),
                      ("a buffer has no PTS in a segment of times"));
    return GST_FLOW_ERROR;
  }
  if (!state->sender.may_have_sent(received, arrival)) {
    reject_second_sender(self, arrival);
    return GST_FLOW_OK;
  }
  const MappedBytes bytes(self.element, std::move(buffer));
  if (!bytes.is_mapped()) return GST_FLOW_ERROR;
  return catch_exceptions(
      self.element,
      Report{GST_RESOURCE_ERROR_NO_SPACE_LEFT, "Not enough memory to receive events."},
      [&] { return receive(self, received, bytes.get(), arrival); });
}

/// Starts a new stream with the next datagram.
static bool start_stream(Private& self, const DatagramSettings& settings) {
  GST_DEBUG_OBJECT(self.element, "expecting datagrams of %dx%d pixels of format %s", settings.width,
                   settings.height, name_of(settings.format));
  const auto report = [](const std::exception& error) {
    return Report{GST_RESOURCE_ERROR_SETTINGS,
                  std::string("Cannot receive events of this sensor in this format: ") +
                      error.what() + ". Select another format, or correct width and height."};
  };
  return catch_exceptions(self.element, report, [&] {
    self.stream->state.emplace(
        State{.settings = settings, .unpacker = make_datagram_unpacker(settings)});
  });
}

static gboolean sink_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  auto& self = priv_of(parent);
  auto& state = self.stream->state;
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_SEGMENT:
      if (!plays_forwards(self.element, event, "receive")) return FALSE;
      if (state) {
        gst_event_copy_segment(event, &state->upstream);
        state->segment_seqnum = gst_event_get_seqnum(event);
      }
      gst_event_unref(event);
      return TRUE;
    case GST_EVENT_CAPS:
    case GST_EVENT_GAP:
      // Events have caps and times of their own.
      gst_event_unref(event);
      return TRUE;
    case GST_EVENT_EOS:
      GST_DEBUG_OBJECT(self.element, "the stream ends");
      break;
    case GST_EVENT_FLUSH_STOP:
      GST_DEBUG_OBJECT(self.element, "flushed: the next datagram begins a stream");
      if (state) start_stream(self, state->settings);
      break;
    default:
      break;
  }
  return gst_pad_event_default(pad, parent, event);
}

static bool start(Private& self) {
  const auto settings = self.settings.copy();
  *self.counts.lock() = {};
  if (settings.width > 0 && settings.height > 0) return start_stream(self, settings);
  GST_ELEMENT_ERROR(self.element, RESOURCE, SETTINGS,
                    ("Cannot receive events: their datagrams do not contain the sensor size. Set "
                     "width and height to match the sender."),
                    ("width=%d height=%d", settings.width, settings.height));
  return false;
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  auto& self = priv_of(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !start(self))
    return GST_STATE_CHANGE_FAILURE;
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_event_datagram_depay_parent_class)->change_state(element, transition);
  self.reports.follow(transition, self.sink);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) self.stream.reset();
  return result;
}

static void gst_event_datagram_depay_init(GstEventDatagramDepay* self) {
  self->priv = new Private(GST_ELEMENT(self), chain, sink_event);
  answer_latency_queries<[](gpointer element) { return priv_of(element).settings.copy().latency; }>(
      self->priv->src);
}

static void gst_event_datagram_depay_class_init(GstEventDatagramDepayClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;

  Properties<field_of<&Private::settings>> properties(object_class);
  add_datagram_properties(properties);
  properties.add_fixed(&DatagramSettings::width, "width",
                       "Width of the sender's sensor (pixels); required", 0, max_side);
  properties.add_fixed(&DatagramSettings::height, "height",
                       "Height of the sender's sensor (pixels); required", 0, max_side);
  properties.add_fixed(
      &Settings::latency, "latency",
      "Maximum delay of events relative to the first one; live sinks wait for it (ns)", 0,
      10 * GST_SECOND);
  install_stats(
      object_class,
      [](GObject* object) {
        const DatagramCounts counts = priv_of(object).counts.copy();
        return new_counters("application/x-event-datagram-stats",
                            {{"packets", counts.packets},
                             {"events", counts.events},
                             {"bytes", counts.bytes},
                             {"lost-packets", counts.lost},
                             {"late-packets", counts.late},
                             {"rejected-packets", counts.rejected}});
      },
      "Counters since the start: packets, events and bytes received; lost packets, if they have a "
      "sequence number; late packets, older than earlier ones and dropped; rejected packets, "
      "malformed or with events outside the sensor");

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = change_state;
  add_pad_templates(element_class, "ANY", EVENT_CAPS);
  set_metadata(klass, "Event datagram depayloader", "Codec/Depayloader/Network",
               "Unpacks events from datagrams of other tools");
}
