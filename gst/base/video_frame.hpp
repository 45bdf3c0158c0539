// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "gst/base/errors.hpp"

/// Report for a frame that does not match its caps.
inline Report cannot_read(const std::string& fault) {
  return {GST_RESOURCE_ERROR_FAILED,
          "Cannot read a video frame: " + fault + ". Check the element upstream."};
}

/// Report for an output buffer that does not match its caps.
inline Report cannot_draw(const std::string& fault) {
  return {GST_RESOURCE_ERROR_FAILED,
          "Cannot draw into an output buffer: " + fault + ". Check the element downstream."};
}

/// Duration of a frame; 0 if the framerate is variable.
inline GstClockTime frame_duration(const GstVideoInfo& video) {
  if (GST_VIDEO_INFO_FPS_N(&video) <= 0) return 0;
  return gst_util_uint64_scale_int(GST_SECOND, GST_VIDEO_INFO_FPS_D(&video),
                                   GST_VIDEO_INFO_FPS_N(&video));
}

/// Maps a buffer as video, with the strides of its GstVideoMeta, if any.
class VideoFrame {
 public:
  VideoFrame(const GstVideoInfo& info, GstBuffer* buffer, GstMapFlags flags) {
    const auto* const meta = gst_buffer_get_video_meta(buffer);
    if (meta != nullptr && !holds(*meta, info)) {
      fault_ = "its GstVideoMeta says " + text_of(meta->format, meta->width, meta->height) +
               ", the caps say " + text_of(info);
      return;
    }
    mapped_ = gst_video_frame_map(&frame_, &info, buffer, flags) != FALSE;
    if (!mapped_ || !rows_fit(info))
      fault_ = text_of(info) + " does not fit into its " +
               std::to_string(gst_buffer_get_size(buffer)) + " bytes";
    // GStreamer sets the size of the GstVideoMeta, which may be larger.
    GST_VIDEO_INFO_WIDTH(&frame_.info) = GST_VIDEO_INFO_WIDTH(&info);
    GST_VIDEO_INFO_HEIGHT(&frame_.info) = GST_VIDEO_INFO_HEIGHT(&info);
  }
  ~VideoFrame() {
    if (mapped_) gst_video_frame_unmap(&frame_);
  }
  VideoFrame(const VideoFrame&) = delete;
  VideoFrame& operator=(const VideoFrame&) = delete;

  /// True if the buffer could be mapped and its rows lie within its memory. Only fault() may be
  /// called if false.
  explicit operator bool() const { return fault_.empty(); }

  const std::string& fault() const { return fault_; }

  const GstVideoFrame* get() const { return &frame_; }
  /// Start of the first plane.
  std::byte* data() const {
    return static_cast<std::byte*>(GST_VIDEO_FRAME_PLANE_DATA(&frame_, 0));
  }
  /// Start of the first component, which is not at the first byte in some packed formats.
  std::byte* first_component() const {
    return reinterpret_cast<std::byte*>(GST_VIDEO_FRAME_COMP_DATA(&frame_, 0));
  }
  /// Bytes from one row of the first plane to the next.
  std::ptrdiff_t stride() const { return GST_VIDEO_FRAME_PLANE_STRIDE(&frame_, 0); }

 private:
  static std::string text_of(GstVideoFormat format, guint width, guint height) {
    return std::string(gst_video_format_to_string(format)) + " of " + std::to_string(width) + "x" +
           std::to_string(height) + " pixels";
  }
  static std::string text_of(const GstVideoInfo& info) {
    return text_of(GST_VIDEO_INFO_FORMAT(&info), static_cast<guint>(GST_VIDEO_INFO_WIDTH(&info)),
                   static_cast<guint>(GST_VIDEO_INFO_HEIGHT(&info)));
  }

  /// True if the frame that a GstVideoMeta describes contains a frame of the caps, which GStreamer
  /// requires.
  static bool holds(const GstVideoMeta& meta, const GstVideoInfo& info) {
    return meta.format == GST_VIDEO_INFO_FORMAT(&info) &&
           meta.width >= static_cast<guint>(GST_VIDEO_INFO_WIDTH(&info)) &&
           meta.height >= static_cast<guint>(GST_VIDEO_INFO_HEIGHT(&info)) &&
           meta.n_planes >= GST_VIDEO_INFO_N_PLANES(&info);
  }

  /// Checks the planes that are accessed: the first, alpha, or all planes of RGB.
  bool rows_fit(const GstVideoInfo& info) const {
    if (GST_VIDEO_INFO_HAS_ALPHA(&info) &&
        !rows_fit(info, GST_VIDEO_INFO_COMP_PLANE(&info, GST_VIDEO_COMP_A)))
      return false;
    const guint planes = GST_VIDEO_INFO_IS_RGB(&info) ? GST_VIDEO_INFO_N_PLANES(&info) : 1;
    for (guint plane = 0; plane < planes; ++plane)
      if (!rows_fit(info, plane)) return false;
    return true;
  }

  /// GStreamer does not check the strides and offsets of a GstVideoMeta.
  bool rows_fit(const GstVideoInfo& info, guint plane) const {
    const std::ptrdiff_t row =
        std::ptrdiff_t{GST_VIDEO_INFO_WIDTH(&info)} * GST_VIDEO_INFO_COMP_PSTRIDE(&info, 0);
    const std::ptrdiff_t sample = GST_VIDEO_INFO_COMP_DEPTH(&info, 0) == 8 ? 1 : 2;
    const std::ptrdiff_t stride = GST_VIDEO_FRAME_PLANE_STRIDE(&frame_, plane);
    const auto* first = static_cast<std::byte*>(GST_VIDEO_FRAME_PLANE_DATA(&frame_, plane));
    // Without a GstVideoMeta, all planes are in one mapping.
    const GstMapInfo& map = frame_.map[frame_.meta != nullptr ? plane : 0];
    const auto offset = first - reinterpret_cast<std::byte*>(map.data);
    const std::ptrdiff_t end = offset + stride * (GST_VIDEO_INFO_HEIGHT(&info) - 1) + row;
    return stride >= row && offset >= 0 && end <= static_cast<std::ptrdiff_t>(map.size) &&
           stride % sample == 0 && reinterpret_cast<std::uintptr_t>(first) % sample == 0;
  }

  GstVideoFrame frame_{};
  bool mapped_ = false;
  std::string fault_;
};
