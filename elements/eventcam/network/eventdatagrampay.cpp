// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventdatagrampay
 * @title: eventdatagrampay
 * @short_description: packs events into datagrams of other tools
 *
 * Packs an event stream into datagrams for SpiNNaker, AEStream, EventCV, faery, Event Stream tools
 * or jAER, selected by #GstEventDatagramPay:format. Each buffer is a datagram: send it with
 * udpsink. Its PTS is the time of its first event.
 *
 * A datagram is sent when it is full, or when its first event cannot wait for another buffer as
 * long as the last one. If no buffer comes, it is sent after #GstEventDatagramPay:max-latency, and
 * events that are further apart share no datagram. If this is 0, each buffer is sent at once, in
 * as few datagrams as possible.
 *
 * jAER's addresses are a DVS128's if the sensor has 128x128 pixels, else a DAVIS's,
 * with up to 1024x512 pixels: select that camera in jAER.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 v4l2src ! eventsim-sparse ! eventdatagrampay format=t32-x16-y15-on1 ! udpsink
 * host=receiver port=5000
 * ]|
 *
 * Since: 0.1
 */
#include <limits>

#include "elements/eventcam/network/datagram_properties.hpp"
#include "elements/eventcam/network/flush_timer.hpp"
#include "gst/base/buffer_bytes.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/pads.hpp"
#include "src/wire/datagrams.hpp"

GST_DEBUG_CATEGORY_STATIC(event_datagram_pay_debug);
#define GST_CAT_DEFAULT event_datagram_pay_debug

/// Caps of datagrams of other tools.
#define DATAGRAM_CAPS                                                         \
  "application/x-event-datagram, format = (string) { spif, spif-timestamps, " \
  "t64-x16-y16-on8, t32-x16-y15-on1, es, jaer }"

using namespace eventcamera;

namespace {

struct Settings : DatagramSettings, PayloaderSettings {};

/// State from start to stop.
struct Stream {
  SensorSize sensor;
  std::unique_ptr<DatagramPacker> packer;
  std::vector<AbsoluteEvent> events;   ///< of the current buffer
  std::vector<OwnedBuffer> datagrams;  ///< complete but not yet pushed
  EventFaults faults{"send", GST_CAT_DEFAULT};
  std::optional<Microseconds> timed;  ///< first event of the datagram that the timer is set for
};

struct Private : ElementPads {
  using ElementPads::ElementPads;

  Guarded<Settings> settings;
  Guarded<DatagramCounts> counts;
  StreamLocked<Stream> stream{sink};
  FlushTimer timer;
};

}  // namespace

DEFINE_EVENT_ELEMENT(GstEventDatagramPay, gst_event_datagram_pay, EVENT_DATAGRAM_PAY, GstElement,
                     GST_TYPE_ELEMENT, eventdatagrampay, GST_RANK_NONE,
                     "datagrams of events for other tools")

static Report report_of(const std::exception& error) {
  if (is_a<std::invalid_argument>(error))
    return {GST_STREAM_ERROR_FORMAT,
            std::string("Cannot send events of this sensor in this format: ") + error.what() +
                ". Select another format."};
  return {GST_RESOURCE_ERROR_NO_SPACE_LEFT, "Not enough memory to send the events."};
}

/// Keeps a datagram until push().
static void keep(Private& self, const Datagram& datagram) {
  OwnedBuffer buffer(copied_buffer(std::as_bytes(datagram.bytes)));
  GST_BUFFER_PTS(buffer.get()) = nanoseconds(datagram.first);
  GST_BUFFER_DURATION(buffer.get()) = nanoseconds(datagram.last - datagram.first);
  self.stream->datagrams.push_back(std::move(buffer));
  const auto counts = self.counts.lock();
  ++counts->packets;
  counts->events += datagram.events;
  counts->bytes += datagram.bytes.size();
}

/// Pushes the kept datagrams as a list, which udpsink sends with one system call.
static GstFlowReturn push(Private& self) {
  if (self.stream->datagrams.empty()) return GST_FLOW_OK;
  GST_LOG_OBJECT(self.src, "%" G_GSIZE_FORMAT " datagrams, the first at %" GST_TIME_FORMAT,
                 self.stream->datagrams.size(),
                 GST_TIME_ARGS(GST_BUFFER_PTS(self.stream->datagrams.front().get())));
  GstBufferList* const list =
      gst_buffer_list_new_sized(static_cast<guint>(self.stream->datagrams.size()));
  for (auto& datagram : self.stream->datagrams) gst_buffer_list_add(list, datagram.release());
  self.stream->datagrams.clear();
  return gst_pad_push_list(self.src, list);
}

static void flush_late(GstObject* element);

/// Limits the time that a new incomplete datagram waits.
static void set_timer(Private& self) {
  const auto since = self.stream->packer ? self.stream->packer->waiting_since() : std::nullopt;
  if (since == self.stream->timed) return;
  self.stream->timed = since;
  if (since)
    self.timer.set(self.settings.copy().max_latency, self.sink, flush_late);
  else
    self.timer.cancel();
}

/// Runs `work`, which packs events, and pushes the datagrams that they complete.
template <class Work>
static GstFlowReturn pack(Private& self, const Work& work) {
  const bool packed = catch_exceptions(self.element, report_of, [&] {
    if (self.stream->packer)
      work(*self.stream->packer, [&](const Datagram& datagram) { keep(self, datagram); });
    set_timer(self);
  });
  if (packed) return push(self);
  self.stream->datagrams.clear();
  return GST_FLOW_ERROR;
}

static GstFlowReturn flush(Private& self) {
  return pack(self, [](DatagramPacker& packer, const auto& send) { packer.flush(send); });
}

static void drop(Private& self) noexcept {
  if (self.stream->packer) self.stream->packer->drop();
  self.stream->timed.reset();
  self.timer.cancel();
}

/// Sends events that have waited for max-latency.
static void flush_late(GstObject* element) {
  GST_LOG_OBJECT(element, "max-latency elapsed: sending an incomplete datagram");
  flush(priv_of(element));
}

/// True if events would wait for too long in the incomplete datagram. `interval` is the current
/// buffer's; the next one is expected to be as long.
static bool is_flush_due(Private& self, const EventInterval& interval) {
  const auto since = self.stream->packer->waiting_since();
  if (!since) return false;
  const auto next = interval.end + (interval.end - interval.start);
  return next >= nanoseconds(*since) + self.settings.copy().max_latency;
}

static void collect(Private& self, GstBuffer* buffer, const MappedEvents& mapped) {
  GST_LOG_OBJECT(self.sink, "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT,
                 mapped.events().size(), GST_TIME_ARGS(GST_BUFFER_PTS(buffer)));
  const auto stream = self.stream.lock();
  stream->events.clear();
  for (const auto& event : mapped.events())
    if (event.x < stream->sensor.width && event.y() < stream->sensor.height)
      stream->events.push_back({mapped.start() + event.t, event.x, event.y_p});
  if (stream->events.size() < mapped.events().size())
    stream->faults.warn(self.element, EventFault::beyond_sensor, buffer);
}

static GstFlowReturn chain(GstPad*, GstObject* parent, GstBuffer* received) {
  auto& self = priv_of(parent);
  const OwnedBuffer buffer(received);
  if (!self.stream->packer) return GST_FLOW_NOT_NEGOTIATED;
  const MappedEvents mapped(received);
  if (!mapped) {
    self.stream->faults.warn(self.element, event_fault(received), received);
    return GST_FLOW_OK;
  }
  return pack(self, [&](DatagramPacker& packer, const auto& send) {
    collect(self, received, mapped);
    const auto max_latency = self.settings.copy().max_latency;  // 0: each buffer is sent at once
    packer.set_max_span(max_latency == 0 ? std::numeric_limits<Microseconds>::max()
                                         : microseconds(max_latency));
    packer.pack(self.stream->events, send);
    if (is_flush_due(self, mapped.interval())) packer.flush(send);
  });
}

static void handle_gap(Private& self, GstEvent* event) {
  GstClockTime start = 0;
  GstClockTime duration = 0;
  gst_event_parse_gap(event, &start, &duration);
  if (!self.stream->packer) return;
  if (!GST_CLOCK_TIME_IS_VALID(duration) || start > G_MAXINT64 || duration > G_MAXINT64 / 2 ||
      is_flush_due(self, {start, start + duration}))
    flush(self);
}

static gboolean handle_caps(Private& self, const GstCaps* caps) {
  const auto sensor = sensor_of(caps);
  if (!sensor) return FALSE;
  if (self.stream->packer && self.stream->sensor == *sensor) return TRUE;
  flush(self);
  Settings settings = self.settings.copy();
  settings.width = sensor->width;
  settings.height = sensor->height;
  if (!catch_exceptions(self.element, report_of,
                        [&] { self.stream->packer = make_datagram_packer(settings); }))
    return FALSE;
  self.stream->sensor = *sensor;
  const OwnedCaps out(gst_caps_new_simple("application/x-event-datagram", "format", G_TYPE_STRING,
                                          name_of(settings.format), nullptr));
  GST_DEBUG_OBJECT(self.element, "sending the events of %dx%d pixels as %" GST_PTR_FORMAT,
                   sensor->width, sensor->height, out.get());
  return gst_pad_push_event(self.src, gst_event_new_caps(out.get()));
}

static gboolean sink_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  auto& self = priv_of(parent);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      const OwnedEvent owned(event);
      return handle_caps(self, caps_of(event));
    }
    case GST_EVENT_GAP:
      handle_gap(self, event);
      break;
    case GST_EVENT_SEGMENT:  // waiting events belong to the previous segment
    case GST_EVENT_SEGMENT_DONE:
    case GST_EVENT_EOS:
      GST_DEBUG_OBJECT(pad, "sending the waiting events before %s", GST_EVENT_TYPE_NAME(event));
      flush(self);
      if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT && !plays_events(self.element, event, "send"))
        return FALSE;
      break;
    case GST_EVENT_FLUSH_STOP:
      GST_DEBUG_OBJECT(pad, "flushed: dropping events that wait");
      drop(self);
      break;
    default:
      break;
  }
  return gst_pad_event_default(pad, parent, event);
}

static GstClockTime latency_of(gpointer element) {
  return priv_of(element).settings.copy().max_latency;
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  auto& self = priv_of(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) *self.counts.lock() = {};
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_event_datagram_pay_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    self.timer.stop();
    self.stream.reset();
  }
  return result;
}

static void gst_event_datagram_pay_init(GstEventDatagramPay* self) {
  self->priv = new Private(GST_ELEMENT(self), chain, sink_event);
  answer_latency_queries<latency_of>(self->priv->src);
  announce_max_latency(self);
}

static void gst_event_datagram_pay_class_init(GstEventDatagramPayClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;

  Properties<field_of<&Private::settings>> properties(object_class);
  add_datagram_properties(properties);
  add_max_latency(properties);
  install_stats(
      object_class,
      [](GObject* object) {
        const DatagramCounts counts = priv_of(object).counts.copy();
        return new_counters(
            "application/x-event-datagram-stats",
            {{"packets", counts.packets}, {"events", counts.events}, {"bytes", counts.bytes}});
      },
      "Counters since the start: packets, events and bytes packed");

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = change_state;
  add_pad_templates(element_class, EVENT_CAPS, DATAGRAM_CAPS);
  set_metadata(klass, "Event datagram payloader", "Codec/Payloader/Network",
               "Packs events into datagrams of other tools");
}
