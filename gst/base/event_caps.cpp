// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/event_caps.hpp"

OwnedCaps event_caps(int width, int height) {
  GstEventCameraInfo info = {};
  info.width = width;
  info.height = height;
  info.fps_d = 1;
  return OwnedCaps(gst_event_camera_info_to_caps(&info));
}
