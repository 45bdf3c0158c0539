// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/owned.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "src/core/sensor_size.hpp"

/// Caps fields of a frame or sensor of any size.
#define SIZE_CAPS \
  "width = (int) [ 1, " G_STRINGIFY(GST_EVENT_CAMERA_MAX_SIDE) " ], " \
  "height = (int) [ 1, " G_STRINGIFY(GST_EVENT_CAMERA_MAX_SIDE) " ]"
static_assert(GST_EVENT_CAMERA_MAX_SIDE == eventcamera::max_side);

/// Caps of an event stream in memory format.
#define EVENT_CAPS GST_EVENT_CAMERA_MEDIA_TYPE ", format = (string) XYTP, " SIZE_CAPS

/// Property of decodebin to get events: are_final_caps() of gstdecodebin2.c stops at these caps.
#define ASK_FOR_EVENTS "caps=\"application/x-event-camera,format=XYTP\""

/// Caps of events in memory format, from a sensor of this size, with a variable framerate.
inline OwnedCaps event_caps(int width, int height) {
  GstEventCameraInfo info = {};
  info.width = width;
  info.height = height;
  info.fps_d = 1;
  return OwnedCaps(gst_event_camera_info_to_caps(&info));
}
