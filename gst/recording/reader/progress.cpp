// SPDX-License-Identifier: LGPL-2.1-or-later
/// Queries, statistics and warnings.
#include <algorithm>
#include <utility>

#include "gst/base/latency.hpp"
#include "gst/recording/reader/event_reader.hpp"

#define GST_CAT_DEFAULT event_reader_debug

void EventReader::log_dropped(guint64 outside, guint64 late, guint64 stray, GstClockTime position) {
  if (outside + late + stray == 0) return;
  const auto level = dropped_level_.next();
  GST_CAT_LEVEL_LOG(GST_CAT_DEFAULT, level, element_,
                    "dropped %" G_GUINT64_FORMAT " events outside the sensor, %" G_GUINT64_FORMAT
                    " late items and %" G_GUINT64_FORMAT
                    " at impossible times, before %" GST_TIME_FORMAT,
                    outside, late, stray, GST_TIME_ARGS(position));
}

/// Updates position and counts, and reports new corruption.
void EventReader::update_progress() {
  const auto counts = recording_->counts();
  const auto position = nanoseconds(recording_->position());
  auto before = counts;
  {
    const auto shared = shared_.lock();
    std::swap(shared->counts, before);
    if (!shared->is_timed) shared->segment.position = std::max(shared->segment.position, position);
  }
  log_dropped(counts.outside - before.outside, counts.late - before.late,
              counts.stray - before.stray, position);
  if (counts.corrupt_places > corrupt_places_)
    for (auto& pad : pads_) pad->interrupt_data();
  if (counts.corrupt_places > 0 && counts.corrupt_places != corrupt_places_) {
    const auto& corruption = recording_->corruption();
    const auto at = std::to_string(corruption.first_at);
    warn_of_corruption_(
        element_,
        {format_.has_many_streams ? GST_STREAM_ERROR_DEMUX : GST_STREAM_ERROR_DECODE,
         "Corrupt data at byte " + at + ": " + corruption.first +
             "; skipping it. The stats property counts what is dropped."},
        std::to_string(counts.corrupt_places) + " corrupt places, the last at byte " +
            std::to_string(corruption.last_at));
  }
  corrupt_places_ = counts.corrupt_places;
}

GstStructure* EventReader::stats() {
  const auto counts = shared_.lock()->counts;
  GstStructure* const stats = gst_structure_new(
      format_.has_many_streams ? "application/x-event-demux-stats"
                               : "application/x-event-decoder-stats",
      "events", G_TYPE_UINT64, counts.events, "triggers", G_TYPE_UINT64, counts.triggers,
      "corrupt-places", G_TYPE_UINT64, counts.corrupt_places, "outside-events", G_TYPE_UINT64,
      counts.outside, "late-items", G_TYPE_UINT64, counts.late, "stray-items", G_TYPE_UINT64,
      counts.stray, "skipped-items", G_TYPE_UINT64, counts.skipped, nullptr);
  if (format_.has_many_streams)
    gst_structure_set(stats, "frames", G_TYPE_UINT64, counts.frames, "imu-samples", G_TYPE_UINT64,
                      counts.imu_samples, nullptr);
  return stats;
}

/// Posts an info message listing the skipped topics.
void EventReader::post_skipped() {
  const auto skipped = recording_->unread_topics();
  if (skipped.empty() || skipped == posted_skipped_) return;
  posted_skipped_ = skipped;
  post_message(element_, GST_MESSAGE_INFO,
               {GST_STREAM_ERROR_DEMUX,
                "The file also has " + skipped + ", which are not read. Set topics to read them."},
               recording_->format_name());
}

/// Posts a warning at the end of a file without events and frames.
void EventReader::warn_if_empty() {
  if (!recording_->is_empty() || is_timed()) return;
  post_message(element_, GST_MESSAGE_WARNING, {GST_STREAM_ERROR_DECODE, "The file has no events."},
               recording_->format_name());
}

/// Posts a warning at the end about dropped items.
void EventReader::warn_of_dropped() {
  const auto counts = recording_->counts();
  const auto text_of = [](guint64 number) { return std::to_string(number); };
  const auto untimely = counts.late + counts.stray;
  GST_INFO_OBJECT(element_, "%" G_GUINT64_FORMAT " corrupt places, %" G_GUINT64_FORMAT " triggers",
                  guint64{counts.corrupt_places}, guint64{counts.triggers});
  if (untimely + counts.outside == 0) return;
  const bool is_assumed = std::ranges::any_of(recording_->streams(), [](const auto& stream) {
    return stream.outside > 0 &&
           stream.size_from == eventcamera::RecordingReader::SizeFrom::assumption;
  });
  post_message(element_, GST_MESSAGE_WARNING,
               {format_.has_many_streams ? GST_STREAM_ERROR_DEMUX : GST_STREAM_ERROR_DECODE,
                text_of(counts.outside) + " events outside the sensor, and " + text_of(untimely) +
                    " items with times out of order, were dropped." +
                    (is_assumed ? " The file does not state its sensor size: if the sensor is "
                                  "larger, set width and height."
                                : "")},
               text_of(counts.late) + " late, " + text_of(counts.stray) + " at stray times");
}

void EventReader::update_duration() {
  const auto length = recording_->duration();
  if (!length) return;
  const auto duration = nanoseconds(*length);
  GstClockTime before = GST_CLOCK_TIME_NONE;
  {
    const auto shared = shared_.lock();
    shared->is_duration_exact = recording_->is_duration_exact();
    before = std::exchange(shared->duration, duration);
  }
  if (before != duration)
    gst_element_post_message(element_, gst_message_new_duration_changed(GST_OBJECT(element_)));
}

/// In push mode, extrapolates the duration from the bytes received so far. None once all bytes are
/// received: formats that are decoded as a whole have output little by then.
GstClockTime EventReader::duration() {
  guint64 pushed = 0;
  GstClockTime position = 0;
  {
    const auto shared = shared_.lock();
    if (GST_CLOCK_TIME_IS_VALID(shared->duration) || shared->is_pulling) return shared->duration;
    pushed = shared->pushed_bytes;
    position = shared->segment.position;
  }
  const guint64 size = upstream_bytes(sink_);
  if (pushed == 0 || pushed >= size || position == 0) return GST_CLOCK_TIME_NONE;
  return gst_util_uint64_scale(position, size, pushed);
}

gboolean EventReader::src_query(GstPad* pad, GstQuery* query) {
  GstFormat format = GST_FORMAT_UNDEFINED;
  if (GST_QUERY_TYPE(query) == GST_QUERY_LATENCY)
    return answer_latency(GST_CAT_DEFAULT, sink_, query, settings_.copy().buffer_duration) ||
           gst_pad_query_default(pad, GST_OBJECT(element_), query);
  if (is_timed()) return gst_pad_query_default(pad, GST_OBJECT(element_), query);
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_POSITION: {
      gst_query_parse_position(query, &format, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      const auto position = shared_.lock()->segment.position;
      gst_query_set_position(query, format, static_cast<gint64>(position));
      return TRUE;
    }
    case GST_QUERY_DURATION: {
      gst_query_parse_duration(query, &format, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      const GstClockTime length = duration();
      if (!GST_CLOCK_TIME_IS_VALID(length)) return FALSE;
      gst_query_set_duration(query, format, static_cast<gint64>(length));
      return TRUE;
    }
    case GST_QUERY_SEEKING:
      gst_query_parse_seeking(query, &format, nullptr, nullptr, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      gst_query_set_seeking(query, format, can_seek(), 0, static_cast<gint64>(duration()));
      return TRUE;
    case GST_QUERY_SEGMENT: {
      const auto segment = shared_.lock()->segment;
      const auto stop = GST_CLOCK_TIME_IS_VALID(segment.stop) ? segment.stop : duration();
      gst_query_set_segment(query, segment.rate, GST_FORMAT_TIME,
                            static_cast<gint64>(segment.start), static_cast<gint64>(stop));
      return TRUE;
    }
    default:
      break;
  }
  return gst_pad_query_default(pad, GST_OBJECT(element_), query);
}
