// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/video/video.h>

#include <cstddef>

/// A buffer mapped as video while it lives; strides are those of its GstVideoMeta, if it has one.
class VideoFrame {
 public:
  VideoFrame(const GstVideoInfo& info, GstBuffer* buffer, GstMapFlags flags)
      : mapped_(gst_video_frame_map(&frame_, &info, buffer, flags)) {}
  ~VideoFrame() {
    if (mapped_) gst_video_frame_unmap(&frame_);
  }
  VideoFrame(const VideoFrame&) = delete;
  VideoFrame& operator=(const VideoFrame&) = delete;

  /// Whether the buffer could be mapped; nothing else may be asked where it could not.
  explicit operator bool() const { return mapped_; }

  void* plane(int i) const { return GST_VIDEO_FRAME_PLANE_DATA(&frame_, i); }
  /// The first byte of component i, within its plane.
  void* component(int i) const { return GST_VIDEO_FRAME_COMP_DATA(&frame_, i); }
  /// Bytes from one row of component i to the next.
  std::ptrdiff_t stride(int i) const { return GST_VIDEO_FRAME_COMP_STRIDE(&frame_, i); }

 private:
  GstVideoFrame frame_{};
  bool mapped_;
};
