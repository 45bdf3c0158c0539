// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatframe.hpp"

#include <algorithm>
#include <new>

using eventcamera::Aedat4Frame;
using eventcamera::Aedat4PixelFormat;

static GstVideoFormat video_format(Aedat4PixelFormat format) {
  switch (format) {
    case Aedat4PixelFormat::grey8:
      return GST_VIDEO_FORMAT_GRAY8;
    case Aedat4PixelFormat::grey16:
      return GST_VIDEO_FORMAT_GRAY16_LE;
    case Aedat4PixelFormat::bgr:
      return GST_VIDEO_FORMAT_BGR;
    case Aedat4PixelFormat::bgra:
      return GST_VIDEO_FORMAT_BGRA;
  }
  return GST_VIDEO_FORMAT_UNKNOWN;
}

static Aedat4PixelFormat pixel_format(GstVideoFormat format) {
  switch (format) {
    case GST_VIDEO_FORMAT_GRAY16_LE:
      return Aedat4PixelFormat::grey16;
    case GST_VIDEO_FORMAT_BGR:
      return Aedat4PixelFormat::bgr;
    case GST_VIDEO_FORMAT_BGRA:
      return Aedat4PixelFormat::bgra;
    default:
      return Aedat4PixelFormat::grey8;
  }
}

bool aedat_frame_info(const Aedat4Frame& frame, GstVideoInfo* info) {
  return gst_video_info_set_format(info, video_format(frame.format),
                                   static_cast<guint>(frame.width),
                                   static_cast<guint>(frame.height));
}

GstBuffer* aedat_frame_buffer(const Aedat4Frame& frame, const GstVideoInfo* info) {
  const gsize size = GST_VIDEO_INFO_SIZE(info);
  // GStreamer's own allocation would end the process where memory is short.
  auto* const memory = static_cast<guint8*>(g_try_malloc0(size));
  if (memory == nullptr) throw std::bad_alloc();
  const auto row = frame.width * eventcamera::bytes_per_pixel(frame.format);
  for (int y = 0; y < frame.height; ++y)
    std::copy_n(frame.pixels + y * frame.stride, row,
                memory + std::ptrdiff_t{y} * GST_VIDEO_INFO_PLANE_STRIDE(info, 0));
  return gst_buffer_new_wrapped(memory, size);
}

Aedat4Frame aedat_frame_of(const GstVideoFrame* video) {
  Aedat4Frame frame;
  frame.format = pixel_format(GST_VIDEO_FRAME_FORMAT(video));
  frame.width = GST_VIDEO_FRAME_WIDTH(video);
  frame.height = GST_VIDEO_FRAME_HEIGHT(video);
  frame.pixels = static_cast<const guint8*>(GST_VIDEO_FRAME_PLANE_DATA(video, 0));
  frame.stride = GST_VIDEO_FRAME_PLANE_STRIDE(video, 0);
  return frame;
}
