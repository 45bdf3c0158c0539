// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "gst/base/guarded.hpp"
#include "gst/base/properties.hpp"
#include "gst/recording/reader/reader_timeline.hpp"
#include "src/formats/recording_reader.hpp"

GST_DEBUG_CATEGORY_EXTERN(event_reader_debug);

/// Statistics of a recording, and messages about its corrupt, dropped and unread content.
class ReaderReports {
 public:
  ReaderReports(GstElement* element, bool has_many_streams)
      : element_(element),
        has_many_streams_(has_many_streams),
        data_error_(has_many_streams ? GST_STREAM_ERROR_DEMUX : GST_STREAM_ERROR_DECODE),
        warn_of_corruption_(event_reader_debug) {}

  /// For a new file.
  void reset() {
    restart();
    warn_of_corruption_.reset();
    dropped_level_.reset();
    posted_streams_.clear();
  }

  /// For a seek: counts from here.
  void restart() {
    *counts_.lock() = {};
    corrupt_places_ = 0;
  }

  void update(const eventcamera::RecordingReader& recording) {
    const auto counts = recording.counts();
    auto before = counts;
    std::swap(*counts_.lock(), before);
    const auto outside = counts.outside - before.outside;
    const auto late = counts.late - before.late;
    const auto stray = counts.stray - before.stray;
    if (outside + late + stray > 0) {
      const auto level = dropped_level_.next();
      GST_CAT_LEVEL_LOG(
          event_reader_debug, level, element_,
          "dropped %" G_GUINT64_FORMAT " events outside the sensor, %" G_GUINT64_FORMAT
          " late items and %" G_GUINT64_FORMAT " at impossible times, before %" GST_TIME_FORMAT,
          guint64{outside}, guint64{late}, guint64{stray},
          GST_TIME_ARGS(nanoseconds(recording.position())));
    }
    has_new_corruption_ = counts.corrupt_places > corrupt_places_;
    if (counts.corrupt_places > 0 && counts.corrupt_places != corrupt_places_) {
      const auto& corruption = recording.corruption();
      warn_of_corruption_(
          element_,
          {data_error_, "Corrupt data at byte " + std::to_string(corruption.first_at) + ": " +
                            corruption.first +
                            "; skipping it. The stats property counts what is dropped."},
          std::to_string(counts.corrupt_places) + " corrupt places, the last at byte " +
              std::to_string(corruption.last_at));
    }
    corrupt_places_ = counts.corrupt_places;
  }

  /// True if the last update() found more corruption.
  bool has_new_corruption() const { return has_new_corruption_; }

  /// The property `stats`. May be called from any thread.
  GstStructure* stats() const {
    const auto counts = counts_.copy();
    GstStructure* const stats = new_counters(
        has_many_streams_ ? "application/x-event-demux-stats" : "application/x-event-decoder-stats",
        {{"events", counts.events},
         {"triggers", counts.triggers},
         {"corrupt-places", counts.corrupt_places},
         {"outside-events", counts.outside},
         {"late-items", counts.late},
         {"stray-items", counts.stray},
         {"skipped-items", counts.skipped}});
    if (has_many_streams_)
      gst_structure_set(stats, "frames", G_TYPE_UINT64, counts.frames, "imu-samples", G_TYPE_UINT64,
                        counts.imu_samples, nullptr);
    return stats;
  }

  /// Posts a warning, once a file, if a compressed file cannot be read from a byte on.
  void post_cut(const std::optional<std::uint64_t>& corrupt_at) {
    if (!corrupt_at) return;
    const auto at = std::to_string(*corrupt_at);
    warn_of_corruption_(element_,
                        {data_error_, "The compressed file is corrupt or cut short at byte " + at +
                                          "; reading only what is before."},
                        "cannot be decompressed from byte " + at + " on");
  }

  /// Posts a warning if the events of a table had to be sorted.
  void post_sorted(const eventcamera::RecordingReader& recording) {
    if (!recording.is_sorted()) return;
    post_message(element_, GST_MESSAGE_WARNING,
                 {data_error_,
                  "The file is not sorted by time. Its events were read into memory and sorted."},
                 "more than one event in a hundred is over 10 ms out of order");
  }

  /// Posts an info message listing the streams that are not read.
  void post_unread_streams(const eventcamera::RecordingReader& recording) {
    const auto [names, property] = recording.unread_streams();
    if (names.empty() || names == posted_streams_) return;
    posted_streams_ = names;
    post_message(
        element_, GST_MESSAGE_INFO,
        {GST_STREAM_ERROR_DEMUX,
         "The file also has " + names + ", which are not read. Set " + property + " to read them."},
        recording.format_name());
  }

  /// At the end of a file: posts warnings if there were no events, or if items were dropped.
  void post_end(const eventcamera::RecordingReader& recording, bool is_timed) {
    if (recording.is_empty() && !is_timed)
      post_message(element_, GST_MESSAGE_WARNING,
                   {GST_STREAM_ERROR_DECODE, "The file has no events."}, recording.format_name());
    const auto counts = recording.counts();
    const auto text_of = [](guint64 number) { return std::to_string(number); };
    const auto untimely = counts.late + counts.stray;
    GST_CAT_INFO_OBJECT(event_reader_debug, element_,
                        "%" G_GUINT64_FORMAT " corrupt places, %" G_GUINT64_FORMAT " triggers",
                        guint64{counts.corrupt_places}, guint64{counts.triggers});
    if (untimely + counts.outside == 0) return;
    const bool is_assumed = std::ranges::any_of(recording.streams(), [](const auto& stream) {
      return stream.outside > 0 &&
             stream.size_from == eventcamera::RecordingReader::SizeFrom::assumption;
    });
    post_message(element_, GST_MESSAGE_WARNING,
                 {data_error_,
                  text_of(counts.outside) + " events outside the sensor, and " + text_of(untimely) +
                      " items with times out of order, were dropped." +
                      (is_assumed ? " The file does not state its sensor size: if the sensor is "
                                    "larger, set width and height."
                                  : "")},
                 text_of(counts.late) + " late, " + text_of(counts.stray) + " at stray times");
  }

 private:
  GstElement* element_;
  bool has_many_streams_;
  ErrorCode data_error_;
  Guarded<eventcamera::RecordingReader::Counts> counts_;
  guint64 corrupt_places_ = 0;  ///< already signalled by DISCONT and a warning
  bool has_new_corruption_ = false;
  WarnOnce warn_of_corruption_;
  RepeatLevel dropped_level_;
  std::string posted_streams_;  ///< in the last message
};
