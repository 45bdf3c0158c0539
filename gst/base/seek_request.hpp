// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <optional>

#include "gst/base/owned.hpp"

class SeekRequest {
 public:
  explicit SeekRequest(GstEvent* event);

  /// True for a seek in time with a positive rate.
  bool plays_on_from_time() const { return format_ == GST_FORMAT_TIME && rate_ > 0; }
  /// True if a position counts from the end of the file.
  bool counts_from_end() const {
    return start_type_ == GST_SEEK_TYPE_END || stop_type_ == GST_SEEK_TYPE_END;
  }
  bool flushes() const { return (flags_ & GST_SEEK_FLAG_FLUSH) != 0; }
  double rate() const { return rate_; }
  GstFormat format() const { return format_; }
  guint32 seqnum() const { return seqnum_; }

  /// Positions, if they are set; a stop that is set to none is -1.
  std::optional<gint64> start() const {
    return start_type_ == GST_SEEK_TYPE_SET ? std::optional(std::max<gint64>(start_, 0))
                                            : std::nullopt;
  }
  std::optional<gint64> stop() const {
    return stop_type_ == GST_SEEK_TYPE_SET ? std::optional(std::max<gint64>(stop_, -1))
                                           : std::nullopt;
  }

  /// The same seek with positions that count from the start of a stream of this duration.
  SeekRequest from_start(gint64 duration) const;
  /// The same seek in a stream that starts `delay` later.
  SeekRequest in_later_stream(gint64 delay) const;
  OwnedEvent event() const;

  /// Applies the seek to `segment`. False if the seek is invalid; `segment` is then unspecified.
  bool apply(GstSegment& segment) const;

 private:
  gdouble rate_ = 1;
  GstFormat format_ = GST_FORMAT_UNDEFINED;
  GstSeekFlags flags_ = GST_SEEK_FLAG_NONE;
  GstSeekType start_type_ = GST_SEEK_TYPE_NONE;
  GstSeekType stop_type_ = GST_SEEK_TYPE_NONE;
  gint64 start_ = 0;
  gint64 stop_ = 0;
  guint32 seqnum_;
};

/// Converts positions from the end into positions from the start, using the duration that a source
/// pad, or the peer of a sink pad, reports; false if unknown. For elements with several inputs,
/// whose durations differ.
bool count_from_start(OwnedEvent& seek, GstPad* pad);

/// True if the element upstream of a sink pad would accept a seek. For elements with several
/// inputs, which must ask all of them before they forward a seek to one.
bool would_seek(GstPad* sink, const SeekRequest& request);
