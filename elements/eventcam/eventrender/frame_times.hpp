// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include "gst/base/event_buffer.hpp"

namespace eventrender {

/// The intervals of pictures at a framerate, one after the other.
class FrameTimes {
 public:
  FrameTimes(GstClockTime origin, const GstVideoInfo& video)
      : origin_(origin),
        fps_n_(static_cast<guint64>(GST_VIDEO_INFO_FPS_N(&video))),
        fps_d_(static_cast<guint64>(GST_VIDEO_INFO_FPS_D(&video))) {}

  /// Rounded up: the intervals of others at the same framerate, rounded down each, then end within
  /// ours.
  EventInterval events() const {
    const auto at = [this](guint64 index) {
      return origin_ + gst_util_uint64_scale_ceil(index, fps_d_ * GST_SECOND, fps_n_);
    };
    return {at(index_), at(index_ + 1)};
  }
  /// What the picture's buffer says.
  EventInterval picture() const {
    const auto at = [this](guint64 index) {
      return origin_ + gst_util_uint64_scale(index, fps_d_ * GST_SECOND, fps_n_);
    };
    return {at(index_), at(index_ + 1)};
  }
  void next() { ++index_; }

 private:
  GstClockTime origin_;
  guint64 fps_n_;
  guint64 fps_d_;
  guint64 index_ = 0;
};

}  // namespace eventrender
