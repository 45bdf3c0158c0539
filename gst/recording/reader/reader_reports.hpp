// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <optional>
#include <string>

#include "gst/base/errors.hpp"
#include "gst/base/guarded.hpp"
#include "src/formats/recording_reader.hpp"

/// What a reader tells users about a recording: statistics, and messages about corrupt, dropped and
/// unread content.
class ReaderReports {
 public:
  ReaderReports(GstElement* element, bool has_many_streams);

  /// For a new file.
  void reset();

  /// For a seek: counts from here.
  void restart();

  /// Updates the counts, and reports new corruption and dropped events.
  void update(const eventcamera::RecordingReader& recording);

  /// True if the last update() found more corruption.
  bool has_new_corruption() const { return has_new_corruption_; }

  /// The property `stats`. May be called from any thread.
  GstStructure* stats() const;

  /// Posts a warning, once a file, if a compressed file cannot be read from a byte on.
  void post_cut(const std::optional<std::uint64_t>& corrupt_at);

  /// Posts a warning if the events of a table had to be sorted.
  void post_sorted(const eventcamera::RecordingReader& recording);

  /// Posts an info message listing the streams that are not read.
  void post_unread_streams(const eventcamera::RecordingReader& recording);

  /// At the end of a file: posts warnings if there were no events, or if items were dropped.
  void post_end(const eventcamera::RecordingReader& recording, bool is_timed);

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
