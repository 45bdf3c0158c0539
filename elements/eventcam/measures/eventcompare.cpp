// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventcompare
 * @title: eventcompare
 * @short_description: measures the similarity of two event streams
 *
 * Compares the stream on the pad `candidate`, which it passes through, with the one on the pad
 * `reference`, over the time that both cover in their segments. The two are synchronized by stream
 * time, and their sensors must have the same size. At EOS of the candidate, at the end of its
 * segment in a segment seek, where stream time goes back, or on stop, it posts an element message
 * `eventcompare`:
 *
 * - `start`, `end` (#gint64): the time covered by both, in stream time (ns);
 * - `reference`, `candidate` (#GstStructure): the statistics of each, as in #GstEventStats;
 * - `map-correlation` (#gdouble): Pearson correlation of the events per pixel;
 * - `rate-correlation` (#gdouble): Pearson correlation of the events per millisecond;
 * - `interval-distance` (#gdouble): Wasserstein distance between the logarithms of the times
 *   between successive events of a pixel, in decades: 0.3 if one stream's are twice as long;
 *   accurate to 0.02; 0 if either stream has none;
 * - `reference-matches`, `candidate-matches` (#GstStructure): the fractions of the events of each
 *   stream that have a match in the other, of the same polarity, at the same pixel or next to it
 *   (#gdouble, `within-1ms`, `within-5ms`, `within-10ms`), and `nearest-distance` (#guint64): the
 *   mean time to the nearest such event, in ns; events without one count as 10 ms;
 * - `noise-ceiling` (#GstStructure): `rate-correlation`, `interval-distance` and `matches` of a
 *   second recording of the reference's scene, estimated from two halves of its events, chosen by
 *   chance (split halves, Spearman-Brown); a good simulator can come out slightly above, since a
 *   camera's events are more regular than chance;
 * - `rate-curve` (#GstStructure): event counts in bins of `bin` ns (#guint64), as two arrays,
 *   `reference` and `candidate`;
 * - `classification` (#GstStructure), if the events of both are labelled (#GstEventSimDvs:label):
 *   how well a filter from the reference to the candidate separates light from noise.
 *   `true-positives`, `false-positives`, `true-negatives`, `false-negatives` (#guint64): light that
 *   is kept, noise that is kept, noise that is dropped, light that is dropped;
 *   `true-positive-rate` (recall), `false-positive-rate` and `precision` (#gdouble). Events of
 *   unknown cause do not count.
 *
 * If the stream time of one input goes back, as in the next recording of a concat, that input waits
 * until the other goes back, too, or ends. Then another comparison starts.
 *
 * The same is written to #GstEventCompare:location as JSON. #GstEventCompare:map shows the events
 * per pixel of the reference, of the candidate and of their difference, blue if the candidate has
 * more and red if it has fewer.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 eventcompare name=compare location=figures.json ! fakesink  filesrc
 * location=real.raw ! evtdec ! compare.reference  filesrc location=drive.mp4 ! decodebin !
 * eventsim-dense ! compare.candidate
 * ]|
 * |[
 * gst-launch-1.0 -m eventcompare name=compare ! fakesink  videotestsrc pattern=ball
 * num-buffers=100 ! eventsim-dvs preset=davis346 label=true ! tee name=t ! queue !
 * compare.reference  t. ! queue ! compare.candidate
 * ]|
 *
 * Since: 0.1
 */
#include "elements/eventcam/measures/report.hpp"
#include "gst/aggregator/eventaggregator.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/guarded.hpp"
#include "src/measure/stream_comparison.hpp"
#include "src/render/rgb_picture.hpp"

GST_DEBUG_CATEGORY_STATIC(event_compare_debug);
#define GST_CAT_DEFAULT event_compare_debug

using namespace eventcamera;

namespace {

const char* name_of(StreamRole role) {
  return role == StreamRole::reference ? "reference" : "candidate";
}

void put_structure(GstStructure* structure, const char* field, GstStructure* value) {
  gst_structure_set(structure, field, GST_TYPE_STRUCTURE, value, nullptr);
  gst_structure_free(value);
}

GstStructure* matches_of(const MatchFigures& matches) {
  return gst_structure_new("matches", "within-1ms", G_TYPE_DOUBLE, matches.shares[0], "within-5ms",
                           G_TYPE_DOUBLE, matches.shares[1], "within-10ms", G_TYPE_DOUBLE,
                           matches.shares[2], "nearest-distance", G_TYPE_UINT64,
                           static_cast<guint64>(matches.nearest_distance * GST_USECOND), nullptr);
}

GstStructure* curve_of(const RateCurve& rates) {
  GstStructure* curve =
      gst_structure_new("rate-curve", "bin", G_TYPE_UINT64,
                        static_cast<guint64>(rates.bin_length()) * GST_USECOND, nullptr);
  for (const auto role : both_roles) {
    GValue counts = G_VALUE_INIT;
    g_value_init(&counts, GST_TYPE_ARRAY);
    for (const auto& bin : rates.bins()) {
      GValue count = G_VALUE_INIT;
      g_value_init(&count, G_TYPE_UINT64);
      g_value_set_uint64(&count, bin[role]);
      gst_value_array_append_and_take_value(&counts, &count);
    }
    gst_structure_take_value(curve, name_of(role), &counts);
  }
  return curve;
}

GstStructure* structure_of(const Classification& classification) {
  return gst_structure_new("classification", "true-positives", G_TYPE_UINT64,
                           guint64{classification.true_positives}, "false-positives", G_TYPE_UINT64,
                           guint64{classification.false_positives}, "true-negatives", G_TYPE_UINT64,
                           guint64{classification.true_negatives}, "false-negatives", G_TYPE_UINT64,
                           guint64{classification.false_negatives}, "true-positive-rate",
                           G_TYPE_DOUBLE, classification.true_positive_rate, "false-positive-rate",
                           G_TYPE_DOUBLE, classification.false_positive_rate, "precision",
                           G_TYPE_DOUBLE, classification.precision, nullptr);
}

GstStructure* structure_of(const StreamComparison& comparison) {
  const auto figures = comparison.figures();
  GstStructure* structure =
      gst_structure_new("eventcompare", "start", G_TYPE_INT64, gint64{figures.start}, "end",
                        G_TYPE_INT64, gint64{figures.end}, nullptr);
  const auto& reference = comparison.causes(StreamRole::reference);
  const auto& candidate = comparison.causes(StreamRole::candidate);
  const bool is_all_dropped = figures.streams[StreamRole::candidate].events == 0;
  if (reference.all() > 0 && (candidate.all() > 0 || is_all_dropped))
    put_structure(structure, "classification",
                  structure_of(Classification::of(reference, candidate)));
  for (const auto role : both_roles) {
    GstStructure* stream = gst_structure_new_empty(name_of(role));
    put_figures(stream, figures.streams[role]);
    put_causes(stream, comparison.causes(role));
    put_structure(structure, name_of(role), stream);
  }
  const auto& similarity = figures.similarity;
  gst_structure_set(structure, "map-correlation", G_TYPE_DOUBLE, similarity.map_correlation,
                    "rate-correlation", G_TYPE_DOUBLE, similarity.rate_correlation,
                    "interval-distance", G_TYPE_DOUBLE, similarity.interval_distance, nullptr);
  put_structure(structure, "reference-matches",
                matches_of(similarity.matches[StreamRole::reference]));
  put_structure(structure, "candidate-matches",
                matches_of(similarity.matches[StreamRole::candidate]));
  GstStructure* ceiling = gst_structure_new(
      "noise-ceiling", "rate-correlation", G_TYPE_DOUBLE, figures.ceiling.rate_correlation,
      "interval-distance", G_TYPE_DOUBLE, figures.ceiling.interval_distance, nullptr);
  put_structure(ceiling, "matches", matches_of(figures.ceiling.matches));
  put_structure(structure, "noise-ceiling", ceiling);
  put_structure(structure, "rate-curve", curve_of(comparison.rates()));
  return structure;
}

class EventCompare final : public EventAggregator {
 public:
  explicit EventCompare(GstAggregator* element)
      : EventAggregator(element, {.verb = "compare", .main_pad = "candidate"}) {}

  bool start() override { return can_report(element(), settings.copy()); }

  void stop() override {
    if (comparison_ && !concluded_) conclude();
    flush();
    reported_ = false;
    sensors_ = {};
    warn_of_missing_.reset();
  }

  void flush() noexcept override { comparison_.reset(); }
  GstClockTime next_time() override { return GST_CLOCK_TIME_NONE; }

  bool handle_caps(GstAggregatorPad* pad, GstCaps* caps) override {
    const auto next = sensor_of(caps);
    if (!next) return false;
    auto& sensor = sensors_[pad == main_pad() ? StreamRole::candidate : StreamRole::reference];
    if (sensor == next) return true;
    for (GstAggregatorPad* other : {pads_[StreamRole::reference], pads_[StreamRole::candidate]})
      if (!gst_pad_is_linked(GST_PAD(other)))
        warn_of_missing_(element(),
                         {GST_CORE_ERROR_PAD,
                          std::string("Nothing to compare with: link a stream to the pad \"") +
                              GST_OBJECT_NAME(other) + "\"."},
                         "the pad is not linked");
    const bool has_begun = comparison_.has_value();
    if (has_begun && !concluded_) conclude();
    flush();
    sensor = next;
    // At once, because aggregate() waits for both streams, and a source whose size changes may wait
    // for one of them. Before the comparison, caps may change until there are events.
    return !has_begun || expect_one_size();
  }

  GstFlowReturn aggregate(bool) override {
    if (has_ended(main_pad()) && !waits_for_reference()) {
      if (!reported_) conclude();
      return GST_FLOW_EOS;
    }
    return expect_one_size() ? aggregate_next() : GST_FLOW_NOT_NEGOTIATED;
  }

  Guarded<ReportFiles> settings;

 private:
  /// True if the next buffer of a stream is earlier than its compared part.
  bool goes_back(StreamRole role) const {
    const auto end = comparison_ ? comparison_->end_of(role) : std::nullopt;
    const auto buffer = next_buffer(pads_[role]);
    const auto interval = end && buffer ? interval_of(buffer.get()) : std::nullopt;
    if (!interval) return false;
    const GstSegment segment = segment_of(pads_[role]);
    const auto clipped = clip(*interval, segment);
    return clipped && stream_time(segment, clipped->start) < *end - Nanoseconds{event_resolution};
  }

  /// True if a stream has no more events in the comparison.
  bool is_over(StreamRole role) const { return has_ended(pads_[role]) || goes_back(role); }

  /// True if the reference does not cover the candidate's buffers so far yet.
  bool waits_for_reference() const {
    return comparison_ && comparison_->behind() == StreamRole::reference &&
           !is_over(StreamRole::reference);
  }

  /// Starts the comparison once both sensors, of one size, are known.
  void begin() {
    const auto& reference = sensors_[StreamRole::reference];
    if (comparison_ || !reference || !sensors_[StreamRole::candidate]) return;
    GST_DEBUG_OBJECT(element(), "comparing sensors of %dx%d pixels", reference->width,
                     reference->height);
    comparison_.emplace(reference->width, reference->height);
    concluded_ = true;
  }

  /// False, after an error message, if both sensors are known and differ.
  bool expect_one_size() const {
    const auto& reference = sensors_[StreamRole::reference];
    const auto& candidate = sensors_[StreamRole::candidate];
    if (reference && candidate && *reference != *candidate) {
      GST_ELEMENT_ERROR(element(), STREAM, FORMAT,
                        ("Cannot compare sensors of different sizes: the reference has %s, the "
                         "candidate %s; scale one of them.",
                         in_pixels(*reference).c_str(), in_pixels(*candidate).c_str()),
                        ("width or height differ in the caps of the two sink pads"));
      return false;
    }
    return true;
  }

  void compare(StreamRole role, GstBuffer* buffer) {
    const MappedEvents mapped(buffer);
    if (!mapped) return warn(event_fault(buffer), buffer);
    const auto& interval = mapped.interval();
    GST_LOG_OBJECT(pads_[role], "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT,
                   mapped.events().size(), GST_TIME_ARGS(interval.start));
    const GstSegment segment = segment_of(pads_[role]);
    const auto clipped = clip(interval, segment);
    if (!clipped) return;
    const auto [events, labels] = ClippedEvents(mapped, buffer, *clipped);
    if (!events.empty()) concluded_ = reported_ = false;
    const auto skipped = comparison_->add(role, events, stream_time(segment, interval.start) / 1000,
                                          stream_time(segment, clipped->start),
                                          stream_time(segment, clipped->end), labels);
    warn(skipped, buffer);
  }

  GstFlowReturn aggregate_next() {
    begin();
    const auto behind = comparison_ ? comparison_->behind() : StreamRole::candidate;
    if (behind == StreamRole::reference && !is_over(StreamRole::reference)) {
      const OwnedBuffer buffer(gst_aggregator_pad_pop_buffer(pads_[StreamRole::reference]));
      if (!buffer) return GST_AGGREGATOR_FLOW_NEED_DATA;
      compare(StreamRole::reference, buffer.get());
      return GST_FLOW_OK;
    }
    if (goes_back(StreamRole::candidate)) {
      if (!is_over(StreamRole::reference))
        return gst_aggregator_pad_drop_buffer(pads_[StreamRole::reference])
                   ? GST_FLOW_OK
                   : GST_AGGREGATOR_FLOW_NEED_DATA;
      GST_DEBUG_OBJECT(element(), "stream time goes back: starting over");
      if (!concluded_) conclude();
      flush();
      return GST_FLOW_OK;
    }
    {
      const auto buffer = next_buffer(main_pad());
      if (!buffer) return GST_AGGREGATOR_FLOW_NEED_DATA;
      if (comparison_ && behind == StreamRole::candidate)
        compare(StreamRole::candidate, buffer.get());
    }
    return push(OwnedBuffer(gst_aggregator_pad_pop_buffer(main_pad())));
  }

  /// Posts and writes the statistics, of empty streams if there is no comparison yet.
  void conclude() {
    concluded_ = reported_ = true;
    const StreamComparison nothing(1, 1);
    const auto& comparison = comparison_ ? *comparison_ : nothing;
    GST_DEBUG_OBJECT(element(), "concluding%s",
                     comparison_ ? "" : ": the caps of one of the streams never came");
    report(element(), settings.copy(), structure_of(comparison), [&] {
      return draw_maps(comparison.map(StreamRole::reference),
                       comparison.map(StreamRole::candidate));
    });
  }

  const PerRole<GstAggregatorPad*> pads_{pad("reference"), pad("candidate")};

  PerRole<std::optional<SensorSize>> sensors_;
  std::optional<StreamComparison> comparison_;  // set once both sensors are known
  bool concluded_ = true;                       // no events since the last report
  bool reported_ = false;                       // and there was one
  WarnOnce warn_of_missing_{GST_CAT_DEFAULT};
};

}  // namespace

DEFINE_EVENT_AGGREGATOR(GstEventCompare, gst_event_compare, EVENT_COMPARE, EventCompare,
                        eventcompare, GST_RANK_NONE, "similarity of event streams")

static void gst_event_compare_class_init(GstEventCompareClass* klass) {
  Properties<aggregator_settings<EventCompare>> properties(G_OBJECT_CLASS(klass));
  add_report_properties(
      properties,
      "PNG file of the events per pixel, of both streams and of their difference, with bars of the "
      "counts, written at EOS, at the end of a segment or on stop");

  auto* const aggregator = GST_EVENT_AGGREGATOR_CLASS(klass);
  add_aggregator_pad_template(aggregator, "reference", GST_PAD_SINK, EVENT_CAPS);
  add_aggregator_pad_template(aggregator, "candidate", GST_PAD_SINK, EVENT_CAPS);
  add_aggregator_pad_template(aggregator, "src", GST_PAD_SRC, EVENT_CAPS);
  set_metadata(klass, "Event comparison", "Filter/Analyzer",
               "Measures the similarity of two event streams");
}
