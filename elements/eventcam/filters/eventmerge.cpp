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
#include <atomic>
#include <map>

#include "gst/aggregator/eventaggregator.hpp"
#include "gst/base/buffer_bytes.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/event_pool.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/properties.hpp"
#include "src/filter/event_merge.hpp"

GST_DEBUG_CATEGORY_STATIC(event_merge_debug);
#define GST_CAT_DEFAULT event_merge_debug

using namespace eventcamera;

namespace {

/// Column and row of the merged sensor where a pad's sensor starts.
struct SensorPosition {
  guint x = 0;
  guint y = 0;

  friend bool operator==(const SensorPosition&, const SensorPosition&) = default;
};

/// Stream of a sink pad.
struct Stream {
  Stream() { stop(); }

  void unload() {
    input.unload();
    loaded.reset();
  }
  void flush() {
    unload();
    discontinuous = segment_is_new = goes_back = false;
  }
  void stop() {
    sensor = {};
    segment_seqnum = GST_SEQNUM_INVALID;
    gst_segment_init(&*segment.lock(), GST_FORMAT_TIME);
  }
  /// Keeps the segment, which a flush resets, for a second seek before the next segment.
  void handle_segment(GstEvent* event) {
    const auto last = std::exchange(*segment.lock(), segment_of(event));
    if (segment_seqnum != GST_SEQNUM_INVALID) segment_is_new |= !continues(last, segment_of(event));
    segment_seqnum = gst_event_get_seqnum(event);
  }

  Guarded<SensorPosition> position;  ///< properties xpos and ypos
  std::atomic<bool> was_linked = false;
  Guarded<GstSegment> segment;  ///< the last one received; a flush does not reset it

  guint32 segment_seqnum = GST_SEQNUM_INVALID;
  bool segment_is_new = false;      ///< not the first segment, and none of its events are merged
  bool goes_back = false;           ///< the loaded interval goes back in a new segment, and waits
  bool has_output_segment = false;  ///< the output has the segment of this pad
  SensorSize sensor;                ///< 0x0 before caps
  SensorPosition placed;            ///< position in the negotiated output
  MergeInput input;
  OwnedBuffer loaded;          ///< queued buffer that `input` was loaded from
  bool discontinuous = false;  ///< that buffer, or one dropped before it, is flagged DISCONT
};

}  // namespace

#define GST_TYPE_EVENT_MERGE_PAD (gst_event_merge_pad_get_type())
G_DECLARE_FINAL_TYPE(GstEventMergePad, gst_event_merge_pad, GST, EVENT_MERGE_PAD, GstAggregatorPad)

struct _GstEventMergePad {
  GstAggregatorPad parent;
  Stream* stream;
};

G_DEFINE_TYPE(GstEventMergePad, gst_event_merge_pad, GST_TYPE_AGGREGATOR_PAD)

static Stream& stream_of(gpointer pad) {
  return *GST_EVENT_MERGE_PAD(pad)->stream;
}
static Stream& stream_of(const OwnedAggregatorPad& pad) {
  return stream_of(pad.get());
}

static Guarded<SensorPosition>& position_of(GObject* pad) {
  return stream_of(pad).position;
}

static void gst_event_merge_pad_init(GstEventMergePad* self) {
  self->stream = new Stream;
  const auto linked = +[](gpointer pad, GstPad*, gpointer) { stream_of(pad).was_linked = true; };
  g_signal_connect(self, "linked", G_CALLBACK(linked), nullptr);
}

static void gst_event_merge_pad_class_init(GstEventMergePadClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = [](GObject* pad) {
    delete &stream_of(pad);
    G_OBJECT_CLASS(gst_event_merge_pad_parent_class)->finalize(pad);
  };
  Properties<position_of> properties(object_class);
  properties.add(&SensorPosition::x, "xpos",
                 "Column of the output where this sensor starts (pixels)", 0, max_side - 1);
  properties.add(&SensorPosition::y, "ypos", "Row of the output where this sensor starts (pixels)",
                 0, max_side - 1);
}

namespace {

/// Stream time of the output, where 0 is the timestamp at which the first input starts: segments,
/// seeks, and queries about them.
class MergedTimeline {
 public:
  explicit MergedTimeline(GstElement* element) : element_(element) {}

  /// Forgets the last seek.
  void reset() { sought_.lock()->reset(); }

  /// Segment of a pad, up to the latest end of all segments.
  static GstSegment longest_segment(const OwnedAggregatorPad& of,
                                    std::span<const OwnedAggregatorPad> pads) {
    GstSegment segment = segment_of(of.get());
    for (const auto& pad : pads)
      segment.stop = std::max(segment.stop, segment_of(pad.get()).stop);  // none is the maximum
    return segment;
  }

  /// Segment of the output: the longest segment of the stream that starts first. Start and stop of
  /// the last seek replace its start and stop, which not all streams may reach.
  GstSegment segment(const OwnedAggregatorPad& first,
                     std::span<const OwnedAggregatorPad> pads) const {
    GstSegment segment = longest_segment(first, pads);
    const auto sought = sought_.copy();
    const auto has_reached = [&](const OwnedAggregatorPad& pad) {
      return stream_of(pad).segment_seqnum == sought->seqnum();
    };
    // Otherwise a further seek is on its way.
    if (!sought || std::ranges::none_of(pads, has_reached)) return segment;
    if (const auto begin = sought->start()) {
      segment.start = segment.position = timestamp_at(*begin);
      segment.time = static_cast<GstClockTime>(*begin);
    }
    if (const auto end = sought->stop(); end && *end >= 0) segment.stop = timestamp_at(*end);
    return segment;
  }

  /// Translates the seek that GstAggregator forwards next to the stream time of each input. Called
  /// from any thread.
  void seek(const SeekRequest& request) {
    const auto last = std::exchange(*sought_.lock(), request);
    if (last && last->seqnum() == request.seqnum()) return;  // a bin sends one to each of its sinks
    const auto zero = start();
    // gst_aggregator_event_forward_func() sends one event to the peer of each pad with
    // gst_pad_send_event(), past the probes of the pad itself, and calls no virtual function.
    for_each_sink_pad(element_, [&](GstAggregatorPad* pad) {
      const OwnedPad peer(gst_pad_get_peer(GST_PAD(pad)));
      if (!peer) return;
      OwnedEvent seek = request.in_later_stream(timestamp_in(pad, 0) - zero).event();
      gst_pad_add_probe(
          peer.get(), GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, replace_seek, seek.release(),
          +[](gpointer event) { gst_event_unref(GST_EVENT(event)); });
    });
  }

  /// Duration up to the end of the last stream; none if no end is known.
  std::optional<gint64> duration() const {
    const auto zero = start();
    std::optional<gint64> longest;
    for_each_sink_pad(element_, [&](GstAggregatorPad* pad) {
      gint64 duration = -1;
      if (gst_pad_peer_query_duration(GST_PAD(pad), GST_FORMAT_TIME, &duration) && duration >= 0)
        longest = std::max(longest.value_or(0), timestamp_in(pad, duration) - zero);
    });
    return longest;
  }

 private:
  /// Timestamp of an input at a stream time; negative before timestamp 0.
  static GstClockTimeDiff timestamp_in(GstAggregatorPad* pad, gint64 stream_time) {
    const GstSegment segment = stream_of(pad).segment.copy();
    guint64 distance = 0;
    const gint sign = gst_segment_position_from_stream_time_full(
        &segment, GST_FORMAT_TIME, static_cast<guint64>(stream_time), &distance);
    return sign * static_cast<GstClockTimeDiff>(distance);
  }

  /// Timestamp at which the first input starts.
  GstClockTimeDiff start() const {
    GstClockTimeDiff start = G_MAXINT64;
    for_each_sink_pad(
        element_, [&](GstAggregatorPad* pad) { start = std::min(start, timestamp_in(pad, 0)); });
    return start;
  }

  GstClockTime timestamp_at(gint64 stream_time) const {
    const auto zero = start();
    if (zero < 0 && stream_time < -zero) return 0;
    return static_cast<GstClockTime>(zero) + static_cast<GstClockTime>(stream_time);
  }

  /// Replaces the next seek with `seek` if they have the same sequence number.
  static GstPadProbeReturn replace_seek(GstPad*, GstPadProbeInfo* info, gpointer seek) {
    GstEvent* const next = GST_PAD_PROBE_INFO_EVENT(info);
    if (GST_EVENT_TYPE(next) != GST_EVENT_SEEK) return GST_PAD_PROBE_OK;
    if (gst_event_get_seqnum(next) == gst_event_get_seqnum(GST_EVENT(seek)))
      gst_event_replace(reinterpret_cast<GstEvent**>(&info->data), GST_EVENT(seek));
    return GST_PAD_PROBE_REMOVE;
  }

  GstElement* element_;
  Guarded<std::optional<SeekRequest>> sought_;  ///< the latest seek
};

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
    for_each_sink_pad(element(), [](GstAggregatorPad* pad) { stream_of(pad).flush(); });
    merger_.restart();
    segment_chosen_ = false;
    discontinuous_ = true;
    waiting_since_ = 0;
  }

  bool handle_caps(GstAggregatorPad* pad, GstCaps* caps) override {
    const auto sensor = sensor_of(caps);
    if (!sensor) return false;
    stream_of(pad).sensor = *sensor;
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
    OwnedBuffer buffer = buffers_.acquire(interval.events * sizeof(Event));
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
    if (position) *stream_of(pad).position.lock() = position.mapped();
  });
  gst_child_proxy_child_added(GST_CHILD_PROXY(element), G_OBJECT(pad), GST_OBJECT_NAME(pad));
  return pad;
}

static void release_pad(GstElement* element, GstPad* pad) {
  const auto& stream = stream_of(pad);
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
    stream_of(pad).handle_segment(event);
  return PARENT_AGGREGATOR_CLASS->sink_event(aggregator, pad, event);
}

static gboolean src_query(GstAggregator* aggregator, GstQuery* query) {
  const auto& timeline = aggregator_impl<EventMerge>(aggregator).timeline;
  GstFormat format = GST_FORMAT_UNDEFINED;
  if (GST_QUERY_TYPE(query) == GST_QUERY_DURATION) {
    gst_query_parse_duration(query, &format, nullptr);
    const auto duration = format == GST_FORMAT_TIME ? timeline.duration() : std::nullopt;
    if (duration) gst_query_set_duration(query, format, *duration);
    if (format == GST_FORMAT_TIME) return duration.has_value();
  }
  if (!PARENT_AGGREGATOR_CLASS->src_query(aggregator, query)) return FALSE;
  if (GST_QUERY_TYPE(query) == GST_QUERY_SEEKING) {
    gboolean seekable = FALSE;
    gst_query_parse_seeking(query, &format, &seekable, nullptr, nullptr);
    const auto duration = timeline.duration();
    if (seekable && format == GST_FORMAT_TIME && duration)
      gst_query_set_seeking(query, format, TRUE, 0, *duration);
  }
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
