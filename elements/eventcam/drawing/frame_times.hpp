// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <algorithm>

#include "gst/base/event_buffer.hpp"

/// Successive intervals of pictures at a framerate. At a rate of playback below 1, they are
/// shorter, so that sinks show as many pictures a second.
class FrameTimes {
 public:
  FrameTimes(GstClockTime origin, const GstVideoInfo& video, double rate)
      : origin_(origin),
        fps_n_(static_cast<guint64>(GST_VIDEO_INFO_FPS_N(&video))),
        fps_d_(static_cast<guint64>(GST_VIDEO_INFO_FPS_D(&video))) {
    if (rate < 1) gst_util_double_to_fraction(rate, &rate_n_, &rate_d_);
    rate_n_ = std::max(rate_n_, 1);
  }

  /// Interval of the picture's events. Rounded up, so that intervals of other elements at the same
  /// framerate, which are rounded down, end within it.
  EventInterval events() const {
    const auto at = [this](guint64 index) {
      const guint64 time = gst_util_uint64_scale_ceil(index, fps_d_ * GST_SECOND, fps_n_);
      return origin_ + gst_util_uint64_scale_int_ceil(time, rate_n_, rate_d_);
    };
    return {at(index_), at(index_ + 1)};
  }
  EventInterval picture() const {
    const auto at = [this](guint64 index) {
      const guint64 time = gst_util_uint64_scale(index, fps_d_ * GST_SECOND, fps_n_);
      return origin_ + gst_util_uint64_scale_int(time, rate_n_, rate_d_);
    };
    return {at(index_), at(index_ + 1)};
  }
  void next() { ++index_; }

 private:
  GstClockTime origin_;
  guint64 fps_n_;
  guint64 fps_d_;
  gint rate_n_ = 1;
  gint rate_d_ = 1;
  guint64 index_ = 0;
};
