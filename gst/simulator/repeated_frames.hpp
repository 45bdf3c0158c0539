// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <cstddef>
#include <cstring>
#include <optional>
#include <utility>

#include "gst/base/owned.hpp"
#include "gst/base/video_frame.hpp"
#include "src/core/event.hpp"

/// Finds the frames that upstream repeats to raise the framerate, as videorate, imagefreeze and
/// webcams do. Such a frame does not show the scene at its time.
class RepeatedFrames {
 public:
  using Nanoseconds = eventcamera::Nanoseconds;

  enum class Kind {
    changed,   ///< another picture
    repeated,  ///< the last picture again
    still,     ///< the last picture, because the scene is still
  };

  /// Compares a frame with the last one. It repeats that if it is flagged GAP or has the same
  /// memory. With `compare`, so does a frame with equal pixels, unless the last frame was a
  /// repetition, too. A picture older than a second is a still scene.
  Kind kind_of(GstBuffer* frame, Nanoseconds time, bool compare, const GstVideoInfo& video) const {
    if (!last_ || time <= last_->time) return Kind::changed;
    GstBuffer* const last = last_->buffer.get();
    const bool is_marked = GST_BUFFER_FLAG_IS_SET(frame, GST_BUFFER_FLAG_GAP) ||
                           (last != nullptr && has_same_memory(last, frame));
    if (!is_marked && !(compare && last != nullptr && has_same_pixels(last, frame, video)))
      return Kind::changed;
    constexpr auto max_age = Nanoseconds{GST_SECOND};
    const bool is_only_one = is_marked || !last_->is_repetition;
    return is_only_one && time - last_->changed <= max_age ? Kind::repeated : Kind::still;
  }

  /// Adds the next frame. With `compare`, the one after it will be compared by its pixels.
  void add(GstBuffer* frame, Nanoseconds time, bool compare, Kind kind) {
    if (kind != Kind::changed) {
      last_->time = time;
      last_->is_repetition = true;
      return;
    }
    OwnedBuffer buffer;
    if (compare || is_shared(frame)) buffer.reset(gst_buffer_ref(frame));
    last_ = Last{std::move(buffer), time, time, false};
  }

  std::optional<Nanoseconds> last_time() const {
    return last_ ? std::optional(last_->time) : std::nullopt;
  }

  /// Forgets the last frame; the next one shows another picture.
  void reset() { last_.reset(); }

 private:
  static bool has_same_memory(GstBuffer* a, GstBuffer* b) {
    const guint count = gst_buffer_n_memory(a);
    if (count == 0 || gst_buffer_n_memory(b) != count) return false;
    for (guint i = 0; i < count; ++i)
      if (gst_buffer_peek_memory(a, i) != gst_buffer_peek_memory(b, i)) return false;
    return true;
  }

  /// True if upstream still holds the frame or its memory, and so may send it again.
  static bool is_shared(GstBuffer* frame) {
    if (GST_MINI_OBJECT_REFCOUNT_VALUE(frame) > 1) return true;
    for (guint i = 0; i < gst_buffer_n_memory(frame); ++i)
      if (GST_MINI_OBJECT_REFCOUNT_VALUE(gst_buffer_peek_memory(frame, i)) > 1) return true;
    return false;
  }

  /// True if the planes that simulators read are equal.
  static bool has_same_pixels(GstBuffer* a, GstBuffer* b, const GstVideoInfo& video) {
    const VideoFrame first(video, a, GST_MAP_READ);
    const VideoFrame second(video, b, GST_MAP_READ);
    if (!first || !second) return false;
    const int planes = GST_VIDEO_INFO_IS_RGB(&video) ? GST_VIDEO_INFO_N_PLANES(&video) : 1;
    const auto row = static_cast<std::size_t>(GST_VIDEO_INFO_WIDTH(&video)) *
                     static_cast<std::size_t>(GST_VIDEO_INFO_COMP_PSTRIDE(&video, 0));
    const auto row_of = [](const VideoFrame& frame, int plane, int y) {
      return static_cast<const guint8*>(GST_VIDEO_FRAME_PLANE_DATA(frame.get(), plane)) +
             std::ptrdiff_t{y} * GST_VIDEO_FRAME_PLANE_STRIDE(frame.get(), plane);
    };
    for (int plane = 0; plane < planes; ++plane)
      for (int y = 0; y < GST_VIDEO_INFO_HEIGHT(&video); ++y)
        if (std::memcmp(row_of(first, plane, y), row_of(second, plane, y), row) != 0) return false;
    return true;
  }

  struct Last {
    OwnedBuffer buffer;   ///< null if neither its memory nor its pixels can appear again
    Nanoseconds time;     ///< of the last frame with this picture
    Nanoseconds changed;  ///< of the first frame with this picture
    bool is_repetition;   ///< there were several
  };

  std::optional<Last> last_;
};
