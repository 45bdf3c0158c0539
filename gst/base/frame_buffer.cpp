// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/frame_buffer.hpp"

#include <algorithm>
#include <new>

using eventcamera::Frame;
using eventcamera::PixelFormat;

static GstVideoFormat video_format(PixelFormat format) {
  switch (format) {
    case PixelFormat::grey8:
      return GST_VIDEO_FORMAT_GRAY8;
    case PixelFormat::grey16:
      return GST_VIDEO_FORMAT_GRAY16_LE;
    case PixelFormat::bgr:
      return GST_VIDEO_FORMAT_BGR;
    case PixelFormat::bgra:
      return GST_VIDEO_FORMAT_BGRA;
  }
  return GST_VIDEO_FORMAT_UNKNOWN;
}

static PixelFormat pixel_format(GstVideoFormat format) {
  switch (format) {
    case GST_VIDEO_FORMAT_GRAY16_LE:
      return PixelFormat::grey16;
    case GST_VIDEO_FORMAT_BGR:
      return PixelFormat::bgr;
    case GST_VIDEO_FORMAT_BGRA:
      return PixelFormat::bgra;
    default:
      return PixelFormat::grey8;
  }
}

bool frame_video_info(const Frame& frame, GstVideoInfo* info) {
  return gst_video_info_set_format(info, video_format(frame.format),
                                   static_cast<guint>(frame.width),
                                   static_cast<guint>(frame.height));
}

GstBuffer* frame_buffer(const Frame& frame, const GstVideoInfo* info) {
  const gsize size = GST_VIDEO_INFO_SIZE(info);
  // GStreamer's own allocator would abort the process if memory is short.
  auto* const memory = static_cast<guint8*>(g_try_malloc0(size));
  if (memory == nullptr) throw std::bad_alloc();
  const auto row = frame.width * eventcamera::bytes_per_pixel(frame.format);
  for (int y = 0; y < frame.height; ++y)
    std::copy_n(frame.pixels + y * frame.stride, row,
                memory + std::ptrdiff_t{y} * GST_VIDEO_INFO_PLANE_STRIDE(info, 0));
  return gst_buffer_new_wrapped(memory, size);
}

Frame recorded_frame(const GstVideoFrame* video) {
  Frame frame;
  frame.format = pixel_format(GST_VIDEO_FRAME_FORMAT(video));
  frame.width = GST_VIDEO_FRAME_WIDTH(video);
  frame.height = GST_VIDEO_FRAME_HEIGHT(video);
  frame.pixels = static_cast<const guint8*>(GST_VIDEO_FRAME_PLANE_DATA(video, 0));
  frame.stride = GST_VIDEO_FRAME_PLANE_STRIDE(video, 0);
  return frame;
}
