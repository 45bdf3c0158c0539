// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/filter/eventfilter.hpp"

#include <limits>

#include "gst/base/buffer_bytes.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/properties.hpp"

GST_DEBUG_CATEGORY_STATIC(event_filter_debug);
#define GST_CAT_DEFAULT event_filter_debug

using namespace eventcamera;

namespace {

/// Counts of events since the start.
struct Counters {
  guint64 received = 0;
  guint64 dropped = 0;   ///< by the filter
  guint64 rejected = 0;  ///< invalid events
};

/// State of a stream, from caps to stop.
struct State {
  SensorSize sensor{};
  SensorSize output{};
  Microseconds passed = std::numeric_limits<Microseconds>::min() / 2;
  Microseconds delay = 0;  ///< added to the times that the filter sees
};

/// State from start to stop.
struct Stream {
  std::optional<State> state;
  EventFaults faults{"filter", GST_CAT_DEFAULT};
};

}  // namespace

struct GstEventFilterPrivate {
  explicit GstEventFilterPrivate(GstBaseTransform* element)
      : stream(GST_BASE_TRANSFORM_SINK_PAD(element)) {}

  std::unique_ptr<EventFilter> impl;
  Guarded<Counters> counters;
  StreamLocked<Stream> stream;
};

G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstEventFilter, gst_event_filter, GST_TYPE_BASE_TRANSFORM,
                                 G_ADD_PRIVATE(GstEventFilter)
                                     GST_DEBUG_CATEGORY_INIT(event_filter_debug, "eventfilter", 0,
                                                             "filters of events"))
#define PARENT_TRANSFORM_CLASS GST_BASE_TRANSFORM_CLASS(gst_event_filter_parent_class)

static GstEventFilterPrivate& priv_of(gpointer self) {
  return *static_cast<GstEventFilterPrivate*>(
      gst_event_filter_get_instance_private(GST_EVENT_FILTER(self)));
}

std::unique_ptr<EventFilter>& gst_event_filter_impl(gpointer element) {
  return priv_of(element).impl;
}

template <class Work>
static auto reported(gpointer self, const Work& work) {
  return catch_exceptions(
      self,
      [](const std::exception& error) -> Report {
        if (is_a<std::bad_alloc>(error))
          return {GST_RESOURCE_ERROR_NO_SPACE_LEFT,
                  "Not enough memory to filter the events; free memory, or lower the resolution."};
        return {GST_STREAM_ERROR_FAILED, std::string("Cannot filter the events: ") + error.what()};
      },
      work);
}

/// Returns the start of a buffer on the time axis of the stream, after forgetting the past if time
/// goes back. Rounded timestamps may overlap by a microsecond; the buffer then counts as later, for
/// a filter that must not see time go back.
static Microseconds continued(gpointer self, LabelledEvents events, Microseconds start) {
  auto& priv = priv_of(self);
  auto& passed = priv.stream->state->passed;
  auto& delay = priv.stream->state->delay;
  if (events.events.empty()) return start;
  const Microseconds overlap = passed - (start + events.events.front().t);
  if (overlap > 1) {
    GST_DEBUG_OBJECT(self, "time goes back by %" G_GINT64_FORMAT " us: forgetting the past",
                     gint64{overlap});
    priv.impl->forget();
    delay = 0;
  } else {
    delay = std::max(delay + overlap, Microseconds{0});
  }
  passed = start + events.events.back().t;
  return start + delay;
}

/// Copies the memory of a writable buffer if its address is not aligned for events. Throws
/// std::bad_alloc.
static void align_events(GstBuffer* buffer) {
  OwnedBuffer copy;
  {
    const WritableBytes mapped(buffer, GST_MAP_READWRITE);
    const auto address = reinterpret_cast<std::uintptr_t>(mapped.get().data());
    if (address % alignof(Event) == 0) return;
    copy.reset(copied_buffer(mapped.get()));
  }
  gst_buffer_replace_all_memory(buffer, gst_buffer_get_memory(copy.get(), 0));
}

static GstFlowReturn transform_ip(GstBaseTransform* transform, GstBuffer* buffer) {
  auto& priv = priv_of(transform);
  if (!priv.stream->state) return GST_FLOW_NOT_NEGOTIATED;
  const auto interval = interval_of(buffer);
  if (!interval || gst_buffer_get_size(buffer) % sizeof(Event) != 0) {
    priv.stream->faults.warn(transform, event_fault(buffer), buffer);
    const auto events = gst_buffer_get_size(buffer) / sizeof(Event);
    const auto counters = priv.counters.lock();
    counters->received += events;
    counters->rejected += events;
    return GST_BASE_TRANSFORM_FLOW_DROPPED;
  }
  return reported(transform, [&] {
    align_events(buffer);
    std::optional<WritableBytes> mapped(std::in_place, buffer, GST_MAP_READWRITE);
    const LabelledEvents all{mapped->events(), labels_of(buffer)};
    const auto max_t = GST_BUFFER_DURATION_IS_VALID(buffer)
                           ? (interval->end - interval->start) / GST_USECOND
                           : GstClockTime{G_MAXUINT32};
    InvalidEvents invalid;
    const auto valid =
        keep_valid(all, priv.stream->state->sensor,
                   static_cast<guint32>(std::min(max_t, GstClockTime{G_MAXUINT32})), invalid);
    const auto start = microseconds(interval->start);
    const auto kept = priv.impl->filter(valid, continued(transform, valid, start));
    mapped.reset();
    truncate_events(buffer, kept.events.size());

    const auto received = all.events.size();
    const auto passed = kept.events.size();
    {
      const auto counters = priv.counters.lock();
      counters->received += received;
      counters->dropped += valid.events.size() - passed;
      counters->rejected += received - valid.events.size();
    }
    priv.stream->faults.warn(transform, invalid, buffer);
    GST_LOG_OBJECT(transform,
                   "%" G_GSIZE_FORMAT " of %" G_GSIZE_FORMAT " events kept at %" GST_TIME_FORMAT,
                   passed, received, GST_TIME_ARGS(interval->start));
    return GST_FLOW_OK;
  });
}

/// A buffer without events becomes a GAP.
static GstFlowReturn generate_output(GstBaseTransform* transform, GstBuffer** out) {
  const GstFlowReturn result = PARENT_TRANSFORM_CLASS->generate_output(transform, out);
  if (result != GST_FLOW_OK || *out == nullptr || gst_buffer_get_size(*out) > 0) return result;
  const OwnedBuffer empty(std::exchange(*out, nullptr));
  return push_event(
      GST_BASE_TRANSFORM_SRC_PAD(transform),
      gst_event_new_gap(GST_BUFFER_PTS(empty.get()), GST_BUFFER_DURATION(empty.get())));
}

/// Copies only the metadata of a shared buffer; its memory is copied on write.
static GstFlowReturn prepare_output_buffer(GstBaseTransform*, GstBuffer* in, GstBuffer** out) {
  *out = gst_buffer_is_writable(in) ? in : gst_buffer_copy(in);
  return GST_FLOW_OK;
}

static gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  auto& priv = priv_of(transform);
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT && !plays_events(transform, event, "filter"))
    return FALSE;
  if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP && priv.stream->state) {
    reported(transform, [&] { priv.impl->forget(); });
    priv.stream->state->passed = State{}.passed;
  }
  return PARENT_TRANSFORM_CLASS->sink_event(transform, event);
}

static gboolean set_caps(GstBaseTransform* transform, GstCaps* in, GstCaps* out) {
  auto& priv = priv_of(transform);
  GstEventCameraInfo from;
  GstEventCameraInfo to;
  if (!gst_event_camera_info_from_caps(&from, in) || !gst_event_camera_info_from_caps(&to, out))
    return FALSE;
  const SensorSize sensor{from.width, from.height};
  const SensorSize output{to.width, to.height};
  if (priv.stream->state && priv.stream->state->sensor == sensor &&
      priv.stream->state->output == output)
    return TRUE;
  GST_DEBUG_OBJECT(transform, "%dx%d pixels in, %dx%d out", from.width, from.height, to.width,
                   to.height);
  priv.stream->state.reset();
  return reported(transform,
                  [&] {
                    priv.impl->start(sensor, output);
                    priv.stream->state = State{.sensor = sensor, .output = output};
                  })
             ? TRUE
             : FALSE;
}

static gboolean start(GstBaseTransform* transform) {
  *priv_of(transform).counters.lock() = {};
  return TRUE;
}

static gboolean stop(GstBaseTransform* transform) {
  auto& priv = priv_of(transform);
  reported(transform, [&] { priv.impl->stop(); });
  priv.stream.reset();
  return TRUE;
}

static GstStructure* stats_of(GObject* object) {
  const Counters counters = priv_of(object).counters.copy();
  return new_counters("application/x-event-filter-stats", {{"events", counters.received},
                                                           {"dropped-events", counters.dropped},
                                                           {"rejected-events", counters.rejected}});
}

static void finalize(GObject* object) {
  std::destroy_at(&priv_of(object));
  G_OBJECT_CLASS(gst_event_filter_parent_class)->finalize(object);
}

static void gst_event_filter_init(GstEventFilter* self) {
  new (&priv_of(self)) GstEventFilterPrivate(GST_BASE_TRANSFORM(self));
  gst_base_transform_set_in_place(GST_BASE_TRANSFORM(self), TRUE);
  gst_base_transform_set_gap_aware(GST_BASE_TRANSFORM(self), TRUE);
}

static void gst_event_filter_class_init(GstEventFilterClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;
  install_stats(object_class, stats_of,
                "Counts of events since the start: events (received), dropped-events (by the "
                "filter), rejected-events (outside the sensor or out of order)");
  add_pad_templates(GST_ELEMENT_CLASS(klass), EVENT_CAPS, EVENT_CAPS);

  GstBaseTransformClass* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->start = start;
  transform_class->stop = stop;
  transform_class->set_caps = set_caps;
  transform_class->sink_event = sink_event;
  transform_class->prepare_output_buffer = prepare_output_buffer;
  transform_class->generate_output = generate_output;
  transform_class->transform_ip = transform_ip;
}
