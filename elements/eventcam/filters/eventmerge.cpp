// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventmerge
 * @title: eventmerge
 * @short_description: merges event streams
 *
 * Merges the events of two or more streams into one, in order of time. Sensors lie over each other,
 * or side by side with the pad properties `xpos` and `ypos`; the output is as large as they need,
 * or as the caps downstream say.
 *
 * Streams are merged by their timestamps, which do not change: recordings of two cameras with one
 * clock stay synchronized. The output has the segment of the stream that starts first, and follows
 * its new ones. A stream that goes back in time with a new segment, as in the next
 * recording of a concat, waits until all others have, too, or have ended. Events of one microsecond
 * are in the order of the pads. Labels stay with their events. Where a stream is flagged DISCONT,
 * so is the output. A seek must flush.
 *
 * Readers of recordings are linked as they start, in any order, and GStreamer may give two at once
 * the same pad: name the pads, as in `m.sink_1`. The output starts once #GstEventMerge:min-streams
 * streams are linked, and an interval is sent once every stream has reached its end, or has ended.
 *
 * Streams from live sources are waited for no longer than the latency, to which
 * #GstAggregator:latency adds, and need a queue before each pad. Later events are dropped, and
 * counted in the property `stats`, as are events outside of their sensor or not sorted.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 eventmerge name=m ! evtenc ! filesink location=both.raw  filesrc location=a.raw !
 * evtdec ! m.sink_0  filesrc location=b.raw ! evtdec ! m.sink_1
 * gst-launch-1.0 eventmerge name=m sink_1::xpos=346 ! eventrender ! videoconvert ! autovideosink
 * filesrc location=left.raw ! evtdec ! m.sink_0  filesrc location=right.raw ! evtdec ! m.sink_1
 * gst-launch-1.0 eventmerge name=m ! eventrender ! videoconvert ! autovideosink  videotestsrc
 * num-buffers=300 is-live=true pattern=ball ! eventsim-dvs ! queue ! m.  videotestsrc
 * num-buffers=300 is-live=true pattern=snow ! eventsim-frame ! queue ! m.
 * ]|
 *
 * Since: 0.1
 */
#include <algorithm>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "elements/eventcam/filters/merged_timeline.hpp"
#include "gst/aggregator/eventaggregator.hpp"
#include "gst/base/buffer_bytes.hpp"
#include "gst/base/event_pool.hpp"

GST_DEBUG_CATEGORY_STATIC(event_merge_debug);
#define GST_CAT_DEFAULT event_merge_debug

using namespace eventcamera;

namespace {

/// Maximum latency that the length of intervals adds.
constexpr GstClockTime max_latency = GST_SECOND;

struct Settings {
  guint min_streams = 2;
};

struct Counts {
  guint64 events = 0;    ///< merged
  guint64 late = 0;      ///< dropped, because earlier than those already sent
  guint64 rejected = 0;  ///< dropped, because outside of their sensor, or not sorted
};

GstEventMergePadPrivate& stream_of(const OwnedAggregatorPad& pad) {
  return *GST_EVENT_MERGE_PAD(pad.get())->priv;
}

/// The pads of an element in order of their numbers.
std::vector<OwnedAggregatorPad> numbered_pads(gpointer element) {
  auto pads = sink_pads(element);
  std::ranges::sort(pads, {}, [](const OwnedAggregatorPad& pad) {
    const std::string name = GST_OBJECT_NAME(pad.get());
    return std::pair(name.size(), name);
  });
  return pads;
}

class EventMerge final : public EventAggregator {
 public:
  explicit EventMerge(GstAggregator* element)
      : EventAggregator(element, {.verb = "merge", .main_pad = nullptr, .passes_main_pad = false}),
        timeline(GST_ELEMENT(element)) {}

  void stop() override {
    flush();
    for (const auto& pad : numbered_pads(element())) stream_of(pad).stop();
    timeline.reset();
    buffers_.reset();
    latency_ = 0;
    gst_aggregator_set_latency(element(), latency_, latency_);
    warn_of_late_.reset();
    warn_of_missing_.reset();
    *counts_.lock() = {};
  }

  void flush() noexcept override {
    for_each_sink_pad(element(),
                      [](GstAggregatorPad* pad) { GST_EVENT_MERGE_PAD(pad)->priv->flush(); });
    merger_.restart();
    segment_chosen_ = false;
    discontinuous_ = true;
    waiting_since_ = 0;
  }

  bool handle_caps(GstAggregatorPad* pad, GstCaps* caps) override {
    const auto sensor = sensor_of(caps);
    if (!sensor) return false;
    GST_EVENT_MERGE_PAD(pad)->priv->sensor = *sensor;
    gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(element()));
    return true;
  }

  GstFlowReturn aggregate(bool timed_out) override {
    auto pads = numbered_pads(element());
    std::vector<MergeInput*> inputs;
    std::vector<MergeInput*> returned;
    bool waiting = false;
    for (const auto& pad : pads) {
      auto& stream = stream_of(pad);
      if (stream.sensor != SensorSize{} && stream.placed != stream.position.copy()) {
        gst_pad_mark_reconfigure(GST_AGGREGATOR_SRC_PAD(element()));
        return GST_FLOW_OK;
      }
      const bool is_loaded = load(pad);
      stream.goes_back = is_loaded && stream.segment_is_new && merger_.goes_back(stream.input);
      if (is_loaded)
        (stream.goes_back ? returned : inputs).push_back(&stream.input);
      else if (!has_ended(pad.get()))
        waiting = true;
    }
    if (inputs.empty() && !waiting && !returned.empty()) {
      GST_DEBUG_OBJECT(element(), "all streams go back");
      std::erase_if(pads, [](const auto& pad) { return !stream_of(pad).input.is_loaded(); });
      inputs.swap(returned);
      merger_.restart();
      segment_chosen_ = false;
      discontinuous_ = true;
      choose_segment(pads);
    }
    const bool all_have_ended = inputs.empty() && !waiting;
    if (!segment_chosen_ && pads.size() < settings.copy().min_streams) {
      if (!inputs.empty() || all_have_ended) timed_out = timed_out || wait_for_streams(pads.size());
      waiting = true;
    }
    if (all_have_ended && (!waiting || timed_out)) {
      choose_segment(pads);
      return GST_FLOW_EOS;
    }
    if (inputs.empty() || (waiting && !timed_out)) return GST_AGGREGATOR_FLOW_NEED_DATA;
    choose_segment(pads);
    const auto interval = merger_.next(inputs);
    count(interval);
    for (const auto& pad : pads) {
      auto& stream = stream_of(pad);
      if (!stream.input.is_loaded() || stream.input.start() >= interval.end || stream.goes_back)
        continue;
      discontinuous_ |= std::exchange(stream.discontinuous, false);
      if (std::exchange(stream.segment_is_new, false) && stream.has_output_segment)
        set_segment(MergedTimeline::longest_segment(pad, pads));
    }
    const GstFlowReturn result = push_interval(interval, inputs);
    for (const auto& pad : pads) {
      auto& stream = stream_of(pad);
      if (!stream.input.is_loaded() || !stream.input.is_merged(interval.end) || stream.goes_back)
        continue;
      stream.unload();
      gst_aggregator_pad_drop_buffer(pad.get());
    }
    return result;
  }

  /// The start of the first queued interval, from which the latency counts.
  GstClockTime next_time() override {
    GstClockTime next = GST_CLOCK_TIME_NONE;
    for (const auto& pad : numbered_pads(element())) {
      const auto buffer = next_buffer(pad.get());
      const auto interval = buffer ? interval_of(buffer.get()) : std::nullopt;
      if (!buffer || stream_of(pad).goes_back) continue;
      const auto start = interval ? running_time(pad.get(), interval->start) : std::nullopt;
      next = std::min(next, start.value_or(0));
    }
    return next;
  }

  void prepare_seek(const SeekRequest& request) override { timeline.seek(request); }

  /// Places the sensors, and chooses an output size that contains them.
  GstFlowReturn choose_caps(GstCaps* downstream, GstCaps** result) {
    SensorSize needed;
    for (const auto& pad : numbered_pads(element())) {
      auto& stream = stream_of(pad);
      if (stream.sensor == SensorSize{}) continue;
      stream.placed = stream.position.copy();
      needed.width =
          std::max(needed.width, static_cast<int>(stream.placed.x) + stream.sensor.width);
      needed.height =
          std::max(needed.height, static_cast<int>(stream.placed.y) + stream.sensor.height);
    }
    if (needed == SensorSize{}) return GST_AGGREGATOR_FLOW_NEED_DATA;
    const auto text = in_pixels(needed);
    if (std::max(needed.width, needed.height) > max_side) {
      GST_ELEMENT_ERROR(element(), STREAM, FORMAT,
                        ("Cannot merge: the output would have %s, more than %d a side. Lower xpos "
                         "and ypos of the pads.",
                         text.c_str(), max_side),
                        ("xpos + width or ypos + height of a pad is too large"));
      return GST_FLOW_NOT_NEGOTIATED;
    }
    GST_DEBUG_OBJECT(element(), "the sensors need %s", text.c_str());
    const OwnedCaps ours(event_caps(needed));
    for (const auto& [side, size] :
         {std::pair("width", needed.width), std::pair("height", needed.height)})
      if (size < max_side)
        gst_caps_set_simple(ours.get(), side, GST_TYPE_INT_RANGE, size, max_side, nullptr);
    *result = gst_caps_intersect_full(downstream, ours.get(), GST_CAPS_INTERSECT_FIRST);
    if (!gst_caps_is_empty(*result)) return GST_FLOW_OK;
    GST_ELEMENT_ERROR(element(), STREAM, FORMAT,
                      ("Cannot merge: the sensors need %s, and downstream does not take that size. "
                       "Do not set a smaller one downstream.",
                       text.c_str()),
                      ("downstream accepts %" GST_PTR_FORMAT, downstream));
    return GST_FLOW_NOT_NEGOTIATED;
  }

  GstStructure* stats() const {
    const Counts counts = counts_.copy();
    return new_counters("application/x-event-merge-stats", {{"events", counts.events},
                                                            {"late-events", counts.late},
                                                            {"rejected-events", counts.rejected}});
  }

  Guarded<Settings> settings;
  MergedTimeline timeline;
  /// Positions of pads that were released before they were ever linked, by name, for the next
  /// request. In a launch line, gst_element_link_pads_full() requests a pad and releases it again
  /// if the pad to link is not there yet, and gst_parse_new_child() of GStreamer's grammar.y sets a
  /// property of the first such pad only.
  Guarded<std::map<std::string, SensorPosition>> unlinked_positions;

 private:
  /// Pauses while streams are missing: gst_aggregator_aggregate_func() waits for data of the
  /// existing pads only, and calls aggregate() again without a pause if all have some. Returns
  /// false if more pauses are needed, true once the latency of live streams has passed.
  bool wait_for_streams(std::size_t linked) {
    constexpr gint64 pause = 10'000;
    constexpr gint64 patience = G_USEC_PER_SEC;  // decodebin adds its pads late
    const GstClockTime latency = gst_aggregator_get_latency(element());
    const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(element()));
    const GstClockTime next = next_time();
    const GstClockTime start = GST_CLOCK_TIME_IS_VALID(next) ? next : 0;
    if (GST_CLOCK_TIME_IS_VALID(latency) && GST_CLOCK_TIME_IS_VALID(now) && now >= start + latency)
      return true;
    if (waiting_since_ == 0) waiting_since_ = g_get_monotonic_time();
    if (g_get_monotonic_time() - waiting_since_ > patience)
      warn_of_missing_(element(),
                       {GST_CORE_ERROR_PAD,
                        "Waiting for another stream to merge: link one, or set min-streams to the "
                        "number of streams."},
                       std::to_string(linked) + " pads are linked");
    g_usleep(pause);
    return false;
  }

  /// Loads the next queued interval of a pad if it is not loaded yet. Returns false if there is
  /// none.
  bool load(const OwnedAggregatorPad& pad) {
    auto& stream = stream_of(pad);
    while (const auto buffer = next_buffer(pad.get())) {
      if (stream.loaded != buffer) stream.discontinuous |= GST_BUFFER_IS_DISCONT(buffer.get());
      if (const auto interval = interval_of(buffer.get())) {
        const auto start = microseconds(interval->start);
        const auto end = microseconds(interval->end);
        if (stream.loaded == buffer || load_events(pad, buffer.get(), end - start)) {
          stream.input.place(start, static_cast<int>(stream.placed.x),
                             static_cast<int>(stream.placed.y));
          return true;
        }
      } else {
        warn(event_fault(buffer.get()), buffer.get());
      }
      gst_aggregator_pad_drop_buffer(pad.get());
    }
    stream.unload();
    return false;
  }

  /// Loads the events of a queued buffer. Returns false if it cannot be mapped as events.
  bool load_events(const OwnedAggregatorPad& pad, GstBuffer* buffer, Microseconds length) {
    auto& stream = stream_of(pad);
    const MappedEvents mapped(buffer);
    if (!mapped) {
      warn(event_fault(buffer), buffer);
      return false;
    }
    GST_LOG_OBJECT(pad.get(), "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT,
                   mapped.events().size(), GST_TIME_ARGS(GST_BUFFER_PTS(buffer)));
    const auto invalid =
        stream.input.load(mapped.events(), labels_of(buffer), stream.sensor, length);
    stream.loaded.reset(gst_buffer_ref(buffer));
    warn(invalid, buffer);
    counts_.lock()->rejected += invalid.outside + invalid.unsorted;
    if (!mapped.events().empty()) raise_latency(nanoseconds(length));
    return true;
  }

  /// A live buffer arrives one interval after its PTS; adds that to the latency.
  void raise_latency(GstClockTime needed) {
    needed = std::min(needed, max_latency);
    if (needed <= latency_) return;
    latency_ = needed;
    GST_DEBUG_OBJECT(element(), "latency %" GST_TIME_FORMAT ", the longest interval",
                     GST_TIME_ARGS(latency_));
    gst_aggregator_set_latency(element(), latency_, latency_);
  }

  void count(const MergedInterval& interval) {
    {
      const auto counts = counts_.lock();
      counts->events += interval.events;
      counts->late += interval.late;
    }
    if (interval.late > 0)
      warn_of_late_(element(),
                    {GST_STREAM_ERROR_FAILED,
                     "Dropped events that arrived too late. Increase the property latency."},
                    std::to_string(interval.late) + " events are earlier than " +
                        std::to_string(interval.start) + " us, up to which events were sent");
  }

  void choose_segment(std::span<const OwnedAggregatorPad> pads) {
    if (pads.empty() || std::exchange(segment_chosen_, true)) return;
    const auto& first = *std::ranges::min_element(
        pads, {}, [](const OwnedAggregatorPad& pad) { return segment_of(pad.get()).start; });
    for (const auto& pad : pads) {
      stream_of(pad).has_output_segment = pad == first;
      stream_of(pad).segment_is_new = stream_of(pad).goes_back = false;
    }
    set_segment(timeline.segment(first, pads));
  }

  GstFlowReturn push_interval(const MergedInterval& interval, EventMerger::Inputs inputs) {
    if (!gst_pad_has_current_caps(GST_AGGREGATOR_SRC_PAD(element()))) return GST_FLOW_OK;
    const auto start = nanoseconds(interval.start);
    const auto duration = nanoseconds(interval.end - interval.start);
    if (interval.events == 0) return push_empty_interval(start, duration);
    const gsize size = interval.events * sizeof(Event);
    OwnedBuffer buffer;
    const GstFlowReturn result = buffers_.acquire(size, buffer);
    if (result != GST_FLOW_OK) return result;
    {
      const WritableBytes mapped(buffer.get());
      LabelledEvents events{.events = mapped.events(), .labels = {}};
      if (interval.labelled) events.labels = add_labels(buffer.get(), interval.events);
      EventMerger::merge(inputs, interval, events);
    }
    stamp(buffer.get(), {start, start + duration}, discontinuous_);
    GST_LOG_OBJECT(element(), "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT, interval.events,
                   GST_TIME_ARGS(start));
    return push(std::move(buffer));
  }

  GstFlowReturn push_empty_interval(GstClockTime start, GstClockTime duration) {
    if (duration == 0) return GST_FLOW_OK;
    GST_LOG_OBJECT(element(), "no events at %" GST_TIME_FORMAT " for %" GST_TIME_FORMAT,
                   GST_TIME_ARGS(start), GST_TIME_ARGS(duration));
    if (!is_segment_sent()) discontinuous_ = false;
    return push_gap(start, duration);
  }

  Guarded<Counts> counts_;
  EventMerger merger_;
  EventBuffers buffers_;
  GstClockTime latency_ = 0;
  bool segment_chosen_ = false;
  bool discontinuous_ = true;  // flag the next buffer DISCONT
  gint64 waiting_since_ = 0;   // for missing streams, monotonic time (us); 0 = not waiting
  WarnOnce warn_of_late_{GST_CAT_DEFAULT};
  WarnOnce warn_of_missing_{GST_CAT_DEFAULT};
};

}  // namespace

static const auto failure = events_report("merge");

static guint children_count(GstChildProxy* self) {
  return catch_exceptions(self, failure,
                          [&] { return static_cast<guint>(numbered_pads(self).size()); });
}

static GObject* child_by_index(GstChildProxy* self, guint index) {
  return catch_exceptions(self, failure, [&]() -> GObject* {
    auto pads = numbered_pads(self);
    return index < pads.size() ? G_OBJECT(pads[index].release()) : nullptr;
  });
}

/// Pads as children, so that a launch line can set their properties.
static void child_proxy_init(gpointer interface, gpointer) {
  auto* const child_proxy = static_cast<GstChildProxyInterface*>(interface);
  child_proxy->get_children_count = children_count;
  child_proxy->get_child_by_index = child_by_index;
}

DEFINE_EVENT_AGGREGATOR(GstEventMerge, gst_event_merge, EVENT_MERGE, EventMerge, eventmerge,
                        GST_RANK_NONE, "merged event streams",
                        implement(g_define_type_id, GST_TYPE_CHILD_PROXY, child_proxy_init))
#define PARENT_ELEMENT_CLASS GST_ELEMENT_CLASS(gst_event_merge_parent_class)
#define PARENT_AGGREGATOR_CLASS GST_AGGREGATOR_CLASS(gst_event_merge_parent_class)

static GstPad* request_new_pad(GstElement* element, GstPadTemplate* pad_template, const gchar* name,
                               const GstCaps* caps) {
  GstPad* const pad = PARENT_ELEMENT_CLASS->request_new_pad(element, pad_template, name, caps);
  if (pad == nullptr) return nullptr;
  catch_exceptions(element, failure, [&] {
    const auto position = aggregator_impl<EventMerge>(element).unlinked_positions.lock()->extract(
        GST_OBJECT_NAME(pad));
    if (position) *GST_EVENT_MERGE_PAD(pad)->priv->position.lock() = position.mapped();
  });
  gst_child_proxy_child_added(GST_CHILD_PROXY(element), G_OBJECT(pad), GST_OBJECT_NAME(pad));
  return pad;
}

static void release_pad(GstElement* element, GstPad* pad) {
  const auto& stream = *GST_EVENT_MERGE_PAD(pad)->priv;
  if (!stream.was_linked)
    catch_exceptions(element, failure, [&] {
      (*aggregator_impl<EventMerge>(element).unlinked_positions.lock())[GST_OBJECT_NAME(pad)] =
          stream.position.copy();
    });
  gst_child_proxy_child_removed(GST_CHILD_PROXY(element), G_OBJECT(pad), GST_OBJECT_NAME(pad));
  PARENT_ELEMENT_CLASS->release_pad(element, pad);
}

static gboolean sink_event(GstAggregator* aggregator, GstAggregatorPad* pad, GstEvent* event) {
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT && segment_of(event).format == GST_FORMAT_TIME)
    GST_EVENT_MERGE_PAD(pad)->priv->handle_segment(event);
  return PARENT_AGGREGATOR_CLASS->sink_event(aggregator, pad, event);
}

static gboolean src_query(GstAggregator* aggregator, GstQuery* query) {
  const auto& timeline = aggregator_impl<EventMerge>(aggregator).timeline;
  GstFormat format = GST_FORMAT_UNDEFINED;
  if (GST_QUERY_TYPE(query) == GST_QUERY_DURATION) {
    gst_query_parse_duration(query, &format, nullptr);
    if (format == GST_FORMAT_TIME) return timeline.answer_duration(query);
  }
  if (!PARENT_AGGREGATOR_CLASS->src_query(aggregator, query)) return FALSE;
  if (GST_QUERY_TYPE(query) == GST_QUERY_SEEKING) timeline.extend_seeking(query);
  return TRUE;
}

static void gst_event_merge_class_init(GstEventMergeClass* klass) {
  Properties<aggregator_settings<EventMerge>> properties(G_OBJECT_CLASS(klass));
  properties.add_fixed(&Settings::min_streams, "min-streams",
                       "Number of linked streams that the output needs to start; live sources wait "
                       "for them no longer than the latency",
                       1, G_MAXUINT);
  install_stats(
      G_OBJECT_CLASS(klass),
      [](GObject* object) { return aggregator_impl<EventMerge>(object).stats(); },
      "Counts: events (merged), late-events (dropped, because they arrived too late) and "
      "rejected-events (dropped, because they are outside of their sensor, or not sorted)");

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  add_pad_template(element_class, "sink_%u", GST_PAD_SINK, EVENT_CAPS, GST_PAD_REQUEST,
                   GST_TYPE_EVENT_MERGE_PAD);
  add_aggregator_pad_template(GST_EVENT_AGGREGATOR_CLASS(klass), "src", GST_PAD_SRC, EVENT_CAPS);
  set_metadata(klass, "Event merger", "Generic", "Merges event streams into one");
  element_class->request_new_pad = request_new_pad;
  element_class->release_pad = release_pad;
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_MERGE_PAD, static_cast<GstPluginAPIFlags>(0));

  GstAggregatorClass* aggregator_class = GST_AGGREGATOR_CLASS(klass);
  aggregator_class->update_src_caps = [](GstAggregator* element, GstCaps* caps, GstCaps** result) {
    return catch_exceptions(element, failure, [&] {
      return aggregator_impl<EventMerge>(element).choose_caps(caps, result);
    });
  };
  aggregator_class->sink_event = sink_event;
  aggregator_class->src_query = src_query;
}
