// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventstats
 * @title: eventstats
 * @short_description: measures an event stream
 *
 * Passes events through and posts element messages `eventstats`: after every
 * #GstEventStats:interval of stream time with the statistics since the last one, and at EOS, at the
 * end of the segment in a segment seek, or on stop with the cumulative statistics.
 * Intervals end at buffer boundaries; events outside the segment are not counted. Invalid events
 * and buffers are passed on unchanged, but not counted, and a warning says why.
 *
 * - `cumulative` (#gboolean): %TRUE for the statistics of the whole stream or segment;
 * - `start`, `end` (#gint64): the time covered, in stream time (ns);
 * - `events` (#guint64), `rate` (#gdouble, events per second);
 * - `on-share` (#gdouble): the fraction of ON events;
 * - `active-share` (#gdouble): the fraction of pixels with events;
 * - `distinct-share` (#gdouble): distinct times per event; 1 if no two events have the same time,
 *   and near 0 if a simulator puts many events at the times of few frames;
 * - `mean`, `std-dev` (#gdouble): over all pixels, events per pixel and second;
 * - `interval-p5`, `-p25`, `-p50`, `-p75`, `-p95` (#guint64, ns): percentiles of the time between
 *   successive events of a pixel, accurate to 3 %;
 * - if events are labelled (#GstEventSimDvs:label): `light-events`, `leak-events`,
 *   `shot-noise-events`, `hot-pixel-events`, `exposure-pulse-events` and `unknown-events`
 *   (#guint64), by cause. After a denoiser, light events are its true positives, and events of
 *   other known causes its false positives.
 *
 * The cumulative statistics are written to #GstEventStats:location as JSON, also on Ctrl-C, and an
 * image of the events per pixel to #GstEventStats:map.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 -m filesrc location=recording.raw ! evtdec ! eventstats map=map.png ! fakesink
 * ]|
 * |[
 * gst-launch-1.0 -m videotestsrc pattern=ball num-buffers=100 ! eventsim-dvs preset=davis346
 * label=true ! eventstats ! fakesink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/base/gstbasetransform.h>

#include <limits>

#include "elements/eventcam/measures/report.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/pads.hpp"
#include "src/measure/event_statistics.hpp"
#include "src/render/rgb_picture.hpp"

GST_DEBUG_CATEGORY_STATIC(event_stats_debug);
#define GST_CAT_DEFAULT event_stats_debug

using namespace eventcamera;

namespace {

struct Settings : ReportFiles {
  GstClockTime interval = GST_SECOND;
};

/// Statistics of a part of the stream.
struct Part {
  EventStatistics statistics;
  CauseCounts causes{};
  std::optional<Nanoseconds> start{};  ///< in stream time
  Nanoseconds covered = 0;

  void restart() {
    statistics.restart();
    causes = {};
    start.reset();
    covered = 0;
  }
};

/// Statistics of the stream of one sensor.
struct Measurement {
  explicit Measurement(SensorSize of)
      : sensor(of),
        validator(of.width, of.height),
        last_times(of.width, of.height),
        cumulative{.statistics = EventStatistics(of.width, of.height)},
        recent{.statistics = EventStatistics(of.width, of.height)} {}

  SensorSize sensor;
  EventValidator validator;
  LastTimes last_times;
  Part cumulative;
  Part recent;                       ///< since the last message
  std::optional<Nanoseconds> end{};  ///< in stream time
  bool concluded = true;             ///< no events since the last report
};

/// State from start to stop.
struct Stream {
  std::optional<Measurement> measurement;
  bool segment_reported = false;  ///< a segment has ended, and so has its measurement
  EventFaults faults{"count", GST_CAT_DEFAULT};
};

struct Private {
  explicit Private(GstBaseTransform* of) : element(of), stream(GST_BASE_TRANSFORM_SINK_PAD(of)) {}

  GstBaseTransform* const element;
  Guarded<Settings> settings;
  StreamLocked<Stream> stream;
};

}  // namespace

DEFINE_EVENT_ELEMENT(GstEventStats, gst_event_stats, EVENT_STATS, GstBaseTransform,
                     GST_TYPE_BASE_TRANSFORM, eventstats, GST_RANK_NONE,
                     "statistics of event streams")
#define PARENT_TRANSFORM_CLASS GST_BASE_TRANSFORM_CLASS(gst_event_stats_parent_class)

template <class Work>
static auto reported(Private& self, const Work& work) {
  return catch_exceptions(self.element, events_report("count"), work);
}

static GstStructure* figures_of(const Part& part, Nanoseconds end, bool cumulative) {
  const Nanoseconds start = part.start.value_or(end);
  GstStructure* structure = gst_structure_new(
      "eventstats", "cumulative", G_TYPE_BOOLEAN, cumulative ? TRUE : FALSE, "start", G_TYPE_INT64,
      gint64{start}, "end", G_TYPE_INT64, gint64{end}, nullptr);
  put_figures(structure, part.statistics.figures(part.covered));
  put_causes(structure, part.causes);
  return structure;
}

static void post(Private& self, GstStructure* structure) {
  gst_element_post_message(GST_ELEMENT(self.element),
                           gst_message_new_element(GST_OBJECT(self.element), structure));
}

/// Reports the statistics of the whole stream, which is empty if no caps were received.
static void conclude(Private& self, const ReportFiles& files) {
  Measurement nothing({1, 1});
  auto& measurement = self.stream->measurement ? *self.stream->measurement : nothing;
  measurement.concluded = true;
  GstStructure* figures = figures_of(measurement.cumulative, measurement.end.value_or(0), true);
  GST_DEBUG_OBJECT(self.element, "concluding: %" GST_PTR_FORMAT, figures);
  report(self.element, files, figures,
         [&] { return draw_map(measurement.cumulative.statistics.map()); });
}

/// True if there were events since the last report.
static bool has_news(Private& self) {
  return self.stream->measurement && !self.stream->measurement->concluded;
}

static void measure(Private& self, SensorSize sensor) {
  GST_DEBUG_OBJECT(self.element, "counting the events of %dx%d pixels", sensor.width,
                   sensor.height);
  self.stream->measurement.emplace(sensor);
}

/// Starts over with the same sensor, if it is known.
static void start_over(Private& self) {
  if (const auto& measurement = self.stream->measurement) measure(self, measurement->sensor);
}

/// Adds an interval. Gaps between intervals count as time without events; if time goes backwards,
/// no inter-event interval spans the discontinuity.
static void cover(Private& self, const EventInterval& interval) {
  auto& measurement = *self.stream->measurement;
  const auto& segment = self.element->segment;
  const Nanoseconds start = stream_time(segment, interval.start);
  const Nanoseconds end = stream_time(segment, interval.end);
  if (measurement.end && start < *measurement.end - static_cast<Nanoseconds>(event_resolution)) {
    GST_DEBUG_OBJECT(self.element,
                     "stream time goes back from %" GST_STIME_FORMAT " to %" GST_STIME_FORMAT,
                     GST_STIME_ARGS(*measurement.end), GST_STIME_ARGS(start));
    measurement.validator.restart();
    measurement.last_times.forget();
    measurement.end.reset();
  }
  const Nanoseconds from = measurement.end.value_or(start);
  for (auto* part : {&measurement.cumulative, &measurement.recent}) {
    if (!part->start) part->start = from;
    const Nanoseconds max_added = std::numeric_limits<Nanoseconds>::max() - part->covered;
    part->covered += std::clamp(end - from, Nanoseconds{0}, max_added);
  }
  measurement.end = std::max(end, from);
}

static void post_if_due(Private& self, Measurement& measurement) {
  const auto interval = static_cast<Nanoseconds>(self.settings.lock()->interval);
  if (interval == 0 || measurement.recent.covered < interval) return;
  post(self, figures_of(measurement.recent, *measurement.end, false));
  measurement.recent.restart();
}

/// Counts the events of a buffer that are in the clipped part of its interval.
static void count(Private& self, Measurement& measurement, GstBuffer* buffer,
                  const EventInterval& clipped) {
  const MappedEvents mapped(buffer);
  if (!mapped) {
    self.stream->faults.warn(self.element, event_fault(buffer), buffer);
    return;
  }
  const auto [events, labels] = ClippedEvents(mapped, buffer, clipped);
  const bool is_labelled = !labels.empty();
  const auto skipped = measurement.validator.for_each_valid(
      events, stream_time(self.element->segment, mapped.interval().start) / 1000,
      length_of(mapped.interval()),
      [&](const AbsoluteEvent& event) {
        measurement.concluded = false;
        const auto interval = measurement.last_times.update(event);
        for (auto* part : {&measurement.cumulative, &measurement.recent}) {
          part->statistics.add(event, interval);
          if (is_labelled) part->causes.add(event.cause);
        }
      },
      labels);
  self.stream->faults.warn(self.element, skipped, buffer);
}

static GstFlowReturn transform_ip(GstBaseTransform* transform, GstBuffer* buffer) {
  auto& self = priv_of(transform);
  auto& measurement = self.stream->measurement;
  const auto interval = interval_of(buffer);
  if (!interval) {
    self.stream->faults.warn(self.element, event_fault(buffer), buffer);
    return GST_FLOW_OK;
  }
  if (!measurement) return GST_FLOW_NOT_NEGOTIATED;
  GST_LOG_OBJECT(self.element, "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT,
                 gst_buffer_get_size(buffer) / sizeof(GstEventCameraEvent),
                 GST_TIME_ARGS(interval->start));
  const auto clipped = clip(*interval, transform->segment);
  if (!clipped) return GST_FLOW_OK;
  return reported(self, [&] {
    cover(self, *clipped);
    count(self, *measurement, buffer, *clipped);
    post_if_due(self, *measurement);
    return GST_FLOW_OK;
  });
}

static void handle_gap(Private& self, GstEvent* event) {
  auto& measurement = self.stream->measurement;
  GstClockTime start = 0;
  GstClockTime duration = 0;
  gst_event_parse_gap(event, &start, &duration);
  if (!measurement || !GST_CLOCK_TIME_IS_VALID(duration) || start > G_MAXINT64) return;
  const GstClockTime end = start + std::min(duration, GstClockTime{G_MAXINT64} - start);
  const auto clipped = clip({start, end}, self.element->segment);
  if (!clipped) return;
  cover(self, *clipped);
  post_if_due(self, *measurement);
}

static gboolean sink_event(GstBaseTransform* transform, GstEvent* event) {
  auto& self = priv_of(transform);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_GAP:
      reported(self, [&] { handle_gap(self, event); });
      break;
    case GST_EVENT_SEGMENT:
      if (!plays_events(self.element, event, "measure")) return FALSE;
      break;
    case GST_EVENT_SEGMENT_DONE:
      self.stream->segment_reported = true;
      reported(self, [&] {
        conclude(self, self.settings.copy());
        start_over(self);
      });
      break;
    case GST_EVENT_EOS:
      if (!self.stream->segment_reported || has_news(self))
        reported(self, [&] { conclude(self, self.settings.copy()); });
      break;
    case GST_EVENT_FLUSH_STOP:
      reported(self, [&] { start_over(self); });
      break;
    default:
      break;
  }
  return PARENT_TRANSFORM_CLASS->sink_event(transform, event);
}

static gboolean set_caps(GstBaseTransform* transform, GstCaps* in, GstCaps*) {
  auto& self = priv_of(transform);
  auto& measurement = self.stream->measurement;
  const auto sensor = sensor_of(in);
  if (!sensor) return FALSE;
  if (measurement && measurement->sensor == *sensor) return TRUE;
  // Each sensor size is measured separately.
  const bool is_measured = reported(self, [&] {
    if (measurement) conclude(self, {});
    measure(self, *sensor);
  });
  return is_measured ? TRUE : FALSE;
}

static gboolean start(GstBaseTransform* transform) {
  auto& self = priv_of(transform);
  return reported(self, [&] { return can_report(self.element, self.settings.copy()); }) ? TRUE
                                                                                        : FALSE;
}

static gboolean stop(GstBaseTransform* transform) {
  auto& self = priv_of(transform);
  if (has_news(self)) reported(self, [&] { conclude(self, self.settings.copy()); });
  self.stream.reset();
  return TRUE;
}

static void gst_event_stats_init(GstEventStats* self) {
  self->priv = new Private(GST_BASE_TRANSFORM(self));
  gst_base_transform_set_passthrough(GST_BASE_TRANSFORM(self), TRUE);
  gst_base_transform_set_gap_aware(GST_BASE_TRANSFORM(self), TRUE);
}

static void gst_event_stats_class_init(GstEventStatsClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;

  Properties<field_of<&Private::settings>> properties(object_class);
  properties.add(&Settings::interval, "interval",
                 "Time between statistics messages, in stream time (ns; 0 = at the end only)", 0,
                 std::numeric_limits<gint64>::max());
  add_report_properties(properties,
                        "PNG file of the events per pixel, with a bar of the counts, written at "
                        "EOS, at the end of a segment or on stop");

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  add_pad_templates(element_class, EVENT_CAPS, EVENT_CAPS);
  set_metadata(klass, "Event statistics", "Filter/Analyzer", "Measures an event stream");

  GstBaseTransformClass* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->start = start;
  transform_class->stop = stop;
  transform_class->set_caps = set_caps;
  transform_class->sink_event = sink_event;
  transform_class->transform_ip = transform_ip;
}
