// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/drawn_formats.hpp"

using eventcamera::PaletteName;

eventcamera::PixelLayout pixel_layout_of(const GstVideoInfo& info) {
  if (GST_VIDEO_INFO_FORMAT(&info) == GST_VIDEO_FORMAT_GRAY8) return {};
  const auto place = [&info](int component) {
    return static_cast<int>(GST_VIDEO_INFO_COMP_POFFSET(&info, component));
  };
  return {.bytes = GST_VIDEO_INFO_COMP_PSTRIDE(&info, GST_VIDEO_COMP_R),
          .red = place(GST_VIDEO_COMP_R),
          .green = place(GST_VIDEO_COMP_G),
          .blue = place(GST_VIDEO_COMP_B)};
}

PaletteName palette_name_of(GstEventCameraPalette palette) {
  switch (palette) {
    case GST_EVENT_CAMERA_PALETTE_LIGHT:
      return PaletteName::light;
    case GST_EVENT_CAMERA_PALETTE_DARK:
      return PaletteName::dark;
    case GST_EVENT_CAMERA_PALETTE_GREY:
      return PaletteName::grey;
    case GST_EVENT_CAMERA_PALETTE_RED_BLUE:
      return PaletteName::red_blue;
    case GST_EVENT_CAMERA_PALETTE_VIRIDIS:
      return PaletteName::viridis;
    case GST_EVENT_CAMERA_PALETTE_MAGMA:
      return PaletteName::magma;
  }
  return PaletteName::dark;
}
