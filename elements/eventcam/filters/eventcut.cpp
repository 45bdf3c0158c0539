// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventcut
 * @title: eventcut
 * @short_description: cuts a stream at external triggers
 *
 * Cuts an event stream at the triggers that readers such as #evtdec send with the events, so that
 * each buffer holds the events between two exposures of a synchronised frame camera. A buffer has
 * the PTS of a trigger and lasts until the next one; an event at the time of a trigger belongs to
 * the window that begins there. A window without events becomes a GAP. #eventtensor then makes a
 * tensor of each window, and #eventrender and #eventreconstruct draw a picture of each at framerate
 * 0/1.
 *
 * Only triggers of #GstEventCut:input with this #GstEventCut:edge cut; all are passed on, ahead of
 * their window. Events before the first trigger and after the last are dropped, and so are windows
 * of more than 71 minutes, and a window that is interrupted by a seek, a new segment, another
 * sensor size or time that goes back; `stats` counts these events. A window has at most 16777216
 * events; further ones are skipped with a warning.
 *
 * A window is output once it is complete. The latency is the longest window so far, but at most a
 * second, since the time of the next trigger is unknown.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventcut edge=rising !
 * eventtensor representation=voxel-grid ! filesink location=voxels.f32
 * ]|
 *
 * Since: 0.1
 */
#include <gst/base/gstbasetransform.h>

#include <limits>

#include "gst/base/buffer_bytes.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/event_pool.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/properties.hpp"
#include "gst/filter/changed_caps.hpp"
#include "gst/recording/sensor_events.hpp"
#include "src/formats/waiting_items.hpp"

GST_DEBUG_CATEGORY_STATIC(event_cut_debug);
#define GST_CAT_DEFAULT event_cut_debug

using namespace eventcamera;

namespace {

/// Maximum number of events in a window; bounds the memory.
constexpr std::size_t max_events = std::size_t{1} << 24;

/// Longest window whose times fit into events.
constexpr Microseconds max_length = std::numeric_limits<guint32>::max();

constexpr GstClockTime max_latency = GST_SECOND;

enum class Edge { rising, falling, both };

struct Settings {
  Edge edge = Edge::rising;
  gint64 input = -1;

  bool cuts_at(const Trigger& trigger) const {
    return trigger.t >= 0 && (edge == Edge::both || trigger.rising == (edge == Edge::rising)) &&
           (input < 0 || trigger.id == input);
  }
};

struct Counters {
  guint64 events = 0;
  guint64 dropped = 0;
  guint64 rejected = 0;
  guint64 windows = 0;
};

/// State from start to stop.
struct Stream {
  SensorSize sensor{};
  std::optional<EventValidator> validator;  ///< once the sensor is known
  WaitingItems<Trigger> triggers;           ///< not reached yet
  std::optional<Microseconds> start;        ///< of the window; none before a trigger
  std::vector<AbsoluteEvent> events;        ///< of the window
  bool is_labelled = false;                 ///< some events had labels
  GstClockTime reached = 0;                 ///< end of the last interval
  bool is_discontinuous = true;             ///< the next buffer is
  EventBuffers buffers;
  EventFaults faults{"cut", GST_CAT_DEFAULT};
  WarnOnce warn_of_excess{GST_CAT_DEFAULT};
};

struct Private {
  explicit Private(GstBaseTransform* of) : element(of), stream(GST_BASE_TRANSFORM_SINK_PAD(of)) {}

  GstBaseTransform* const element;
  Guarded<Settings> settings;
  Guarded<Counters> counters;
  Guarded<GstClockTime> latency;
  StreamLocked<Stream> stream;
};

}  // namespace

DEFINE_EVENT_ELEMENT(GstEventCut, gst_event_cut, EVENT_CUT, GstBaseTransform,
                     GST_TYPE_BASE_TRANSFORM, eventcut, GST_RANK_NONE, "windows between triggers")
#define PARENT_TRANSFORM_CLASS GST_BASE_TRANSFORM_CLASS(gst_event_cut_parent_class)

template <class Work>
static auto reported(Private& self, const Work& work) {
  return catch_exceptions(self.element, events_report("cut"), work);
}

/// Drops the window, and waits for the trigger that starts the next one.
static void start_over(Private& self) {
  const auto stream = self.stream.lock();
  self.counters.lock()->dropped += stream->events.size();
  stream->events.clear();
  stream->start.reset();
  stream->is_labelled = false;
  stream->reached = 0;
  stream->is_discontinuous = true;
  if (stream->validator) stream->validator->restart();
}

static void lengthen_latency(Private& self, GstClockTime duration) {
  {
    const auto latency = self.latency.lock();
    if (std::min(duration, max_latency) <= *latency) return;
    *latency = std::min(duration, max_latency);
  }
  post_latency(self.element);
}

static GstFlowReturn push_window(Private& self, std::span<const AbsoluteEvent> events,
                                 Microseconds end) {
  const auto stream = self.stream.lock();
  GstPad* const src = GST_BASE_TRANSFORM_SRC_PAD(self.element);
  const Microseconds start = *stream->start;
  const GstClockTime pts = nanoseconds(start);
  const GstClockTime duration = nanoseconds(end - start);
  GST_LOG_OBJECT(self.element,
                 "window of %" G_GSIZE_FORMAT " events from %" GST_TIME_FORMAT
                 " to %" GST_TIME_FORMAT,
                 events.size(), GST_TIME_ARGS(pts), GST_TIME_ARGS(pts + duration));
  ++self.counters.lock()->windows;
  lengthen_latency(self, duration);
  if (events.empty()) return push_event(src, gst_event_new_gap(pts, duration));

  OwnedBuffer buffer = stream->buffers.acquire(events.size() * sizeof(Event));
  std::ranges::transform(events, WritableBytes(buffer.get()).events().begin(),
                         [start](const AbsoluteEvent& event) {
                           return Event{static_cast<guint32>(event.t - start), event.x, event.y_p};
                         });
  if (stream->is_labelled)
    std::ranges::transform(events, add_labels(buffer.get(), events.size()).begin(), label_of);
  stamp(buffer.get(), {pts, pts + duration}, stream->is_discontinuous);
  return gst_pad_push(src, buffer.release());
}

/// Pushes the windows that end in the interval, whose events have been added. Before the first
/// window, a GAP without duration, of which no tensor or picture is made, says that time passes.
static GstFlowReturn advance(Private& self, const EventInterval& interval) {
  const auto stream = self.stream.lock();
  stream->reached = std::max(stream->reached, interval.end);
  const auto reached = microseconds(stream->reached);
  GstFlowReturn result = GST_FLOW_OK;
  std::span<const AbsoluteEvent> rest = stream->events;
  for (const auto& trigger : stream->triggers.pop_before(reached + 1)) {
    if (result != GST_FLOW_OK) break;
    if (stream->start && trigger.t <= *stream->start) continue;  // late, or of another input
    const auto next = std::ranges::lower_bound(rest, trigger.t, {}, &AbsoluteEvent::t);
    const auto before = rest.first(static_cast<std::size_t>(next - rest.begin()));
    if (stream->start && trigger.t - *stream->start <= max_length)
      result = push_window(self, before, trigger.t);
    else
      self.counters.lock()->dropped += before.size();
    rest = rest.subspan(before.size());
    stream->start = trigger.t;
    stream->validator->pass(trigger.t);
  }
  stream->events.erase(stream->events.begin(),
                       stream->events.end() - static_cast<std::ptrdiff_t>(rest.size()));
  if (stream->start) return result;
  self.counters.lock()->dropped += stream->events.size();
  stream->events.clear();
  return push_event(GST_BASE_TRANSFORM_SRC_PAD(self.element),
                    gst_event_new_gap(interval.start, GST_CLOCK_TIME_NONE));
}

/// Starts over if an interval is earlier than the last one. Triggers that wait belong to it.
static void start_over_if_earlier(Private& self, const EventInterval& interval) {
  const GstClockTime reached = self.stream->reached;
  if (interval.start + event_resolution >= reached) return;
  GST_DEBUG_OBJECT(self.element, "time goes back from %" GST_TIME_FORMAT " to %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(reached), GST_TIME_ARGS(interval.start));
  start_over(self);
}

static void add(Private& self, const MappedEvents& mapped, GstBuffer* buffer) {
  const auto stream = self.stream.lock();
  const auto labels = labels_of(buffer);
  stream->is_labelled |= !labels.empty();
  std::size_t excess = 0;
  const auto keep = [&](const AbsoluteEvent& event) {
    if (stream->events.size() < max_events)
      stream->events.push_back(event);
    else
      ++excess;
  };
  const auto invalid = stream->validator->for_each_valid(
      mapped.events(), mapped.start(), length_of(mapped.interval()), keep, labels);
  stream->faults.warn(self.element, invalid, buffer);
  if (excess > 0)
    stream->warn_of_excess(
        self.element,
        {GST_STREAM_ERROR_FAILED, "Cannot keep all events: there are more than " +
                                      std::to_string(max_events) +
                                      " in a window; skipping the rest. Check input and edge."},
        std::to_string(excess) + " events skipped");
  const auto counters = self.counters.lock();
  counters->dropped += excess;
  counters->rejected += invalid.outside + invalid.unsorted;
}

static GstFlowReturn submit_input_buffer(GstBaseTransform* transform, gboolean, GstBuffer* input) {
  auto& self = priv_of(transform);
  const OwnedBuffer buffer(input);
  const auto stream = self.stream.lock();
  if (!stream->validator) return GST_FLOW_NOT_NEGOTIATED;
  const auto events = gst_buffer_get_size(input) / sizeof(Event);
  self.counters.lock()->events += events;
  const MappedEvents mapped(input);
  if (!mapped) {
    stream->faults.warn(self.element, event_fault(input), input);
    self.counters.lock()->rejected += events;
    return GST_FLOW_OK;
  }
  const auto& interval = mapped.interval();
  GST_LOG_OBJECT(self.element, "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT, events,
                 GST_TIME_ARGS(interval.start));
  return reported(self, [&] {
    start_over_if_earlier(self, interval);
    if (GST_BUFFER_IS_DISCONT(input)) {
      const auto result = advance(self, {interval.start, interval.start});
      if (result != GST_FLOW_OK) return result;
      stream->is_discontinuous = true;
    }
    add(self, mapped, input);
    return advance(self, interval);
  });
}

static bool handle_gap(Private& self, GstEvent* event) {
  GstClockTime start = 0;
  GstClockTime duration = 0;
  gst_event_parse_gap(event, &start, &duration);
  if (!self.stream->validator || start > G_MAXINT64) return true;
  if (!GST_CLOCK_TIME_IS_VALID(duration)) duration = 0;
  const EventInterval interval{start, start + std::min(duration, GstClockTime{G_MAXINT64} - start)};
  start_over_if_earlier(self, interval);
  return advance(self, interval) == GST_FLOW_OK;
}

static void add_triggers(Private& self, GstEvent* event) {
  auto triggers = triggers_of(event);
  const auto stream = self.stream.lock();
  if (!triggers || stream->triggers.is_full()) return;
  const Settings settings = self.settings.copy();
  std::erase_if(*triggers, [&](const Trigger& trigger) { return !settings.cuts_at(trigger); });
  stream->triggers.push(*triggers);
}

static void warn_without_windows(Private& self) {
  const Counters counters = self.counters.copy();
  if (counters.events > 0 && counters.windows == 0)
    post_message(self.element, GST_MESSAGE_WARNING,
                 {GST_STREAM_ERROR_FAILED,
                  "There are no windows: fewer than two triggers cut these events. Check the "
                  "properties input and edge, and that the recording has triggers."},
                 std::to_string(counters.dropped) + " events dropped");
}

static gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  auto& self = priv_of(transform);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CUSTOM_DOWNSTREAM:
      reported(self, [&] { add_triggers(self, event); });
      break;
    case GST_EVENT_GAP: {
      const OwnedEvent gap(event);
      return reported(self, [&] { return handle_gap(self, event); }) ? TRUE : FALSE;
    }
    case GST_EVENT_SEGMENT:
      if (!plays_events(self.element, event, "cut")) return FALSE;
      if (continues(transform->segment, segment_of(event))) break;
      [[fallthrough]];
    case GST_EVENT_SEGMENT_DONE:
    case GST_EVENT_EOS:
    case GST_EVENT_FLUSH_STOP:
      self.stream->triggers.clear();
      start_over(self);
      if (GST_EVENT_TYPE(event) == GST_EVENT_EOS) warn_without_windows(self);
      break;
    default:
      break;
  }
  return PARENT_TRANSFORM_CLASS->sink_event(transform, event);
}

static gboolean query(GstBaseTransform* transform, GstPadDirection direction, GstQuery* query) {
  if (direction == GST_PAD_SRC && GST_QUERY_TYPE(query) == GST_QUERY_LATENCY)
    return answer_latency(GST_BASE_TRANSFORM_SINK_PAD(transform), query,
                          priv_of(transform).latency.copy());
  return PARENT_TRANSFORM_CLASS->query(transform, direction, query);
}

/// Windows have no framerate.
static GstCaps* transform_caps(GstBaseTransform*, GstPadDirection direction, GstCaps* caps,
                               GstCaps* filter) {
  return changed_caps(caps, filter, [direction](GstStructure* structure) {
    if (direction == GST_PAD_SINK)
      gst_structure_set(structure, "framerate", GST_TYPE_FRACTION, 0, 1, nullptr);
    else
      gst_structure_remove_field(structure, "framerate");
    return true;
  });
}

static gboolean set_caps(GstBaseTransform* transform, GstCaps* in, GstCaps*) {
  auto& self = priv_of(transform);
  const auto sensor = sensor_of(in);
  if (!sensor) return FALSE;
  const auto stream = self.stream.lock();
  if (stream->validator && stream->sensor == *sensor) return TRUE;
  start_over(self);
  stream->sensor = *sensor;
  stream->validator.emplace(sensor->width, sensor->height);
  return TRUE;
}

static gboolean start(GstBaseTransform* transform) {
  *priv_of(transform).counters.lock() = {};
  return TRUE;
}

static gboolean stop(GstBaseTransform* transform) {
  priv_of(transform).stream.reset();
  *priv_of(transform).latency.lock() = 0;
  return TRUE;
}

static GstStructure* stats_of(GObject* object) {
  const Counters counters = priv_of(object).counters.copy();
  return new_counters("application/x-event-cut-stats", {{"events", counters.events},
                                                        {"dropped-events", counters.dropped},
                                                        {"rejected-events", counters.rejected},
                                                        {"windows", counters.windows}});
}

static void gst_event_cut_init(GstEventCut* self) {
  self->priv = new Private(GST_BASE_TRANSFORM(self));
  gst_base_transform_set_passthrough(GST_BASE_TRANSFORM(self), FALSE);
}

static void gst_event_cut_class_init(GstEventCutClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;
  Properties<field_of<&Private::settings>> properties(object_class);
  properties.add(&Settings::edge, "edge", "Edges of triggers to cut at",
                 enum_type<Edge>("GstEventCutEdge", {{Edge::rising, "Rising edges", "rising"},
                                                     {Edge::falling, "Falling edges", "falling"},
                                                     {Edge::both, "Both edges", "both"}}));
  properties.add(&Settings::input, "input", "Number of the trigger input to cut at (-1 = all)", -1,
                 G_MAXUINT16);
  install_stats(object_class, stats_of,
                "Counts since the start: events (received), dropped-events (outside of windows), "
                "rejected-events (outside the sensor or out of order), windows (pushed)");
  add_pad_templates(GST_ELEMENT_CLASS(klass), EVENT_CAPS, EVENT_CAPS);
  set_metadata(klass, "Event cutter", "Filter", "Cuts a stream at external triggers");

  GstBaseTransformClass* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->start = start;
  transform_class->stop = stop;
  transform_class->transform_caps = transform_caps;
  transform_class->set_caps = set_caps;
  transform_class->query = query;
  transform_class->sink_event = sink_event;
  transform_class->submit_input_buffer = submit_input_buffer;
}
