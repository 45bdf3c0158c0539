// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// What a seek event asks for.
class SeekRequest {
 public:
  explicit SeekRequest(GstEvent* event);

  /// Whether it asks for a time to play forwards from.
  bool plays_on_from_time() const { return format_ == GST_FORMAT_TIME && rate_ > 0; }
  bool flushes() const { return (flags_ & GST_SEEK_FLAG_FLUSH) != 0; }
  double rate() const { return rate_; }
  GstFormat format() const { return format_; }
  guint32 seqnum() const { return seqnum_; }

  /// Makes a segment the one that is asked for. False where there is none such: then it is of no
  /// use.
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
