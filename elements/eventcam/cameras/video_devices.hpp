// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "elements/eventcam/cameras/event_camera.hpp"

struct FoundDevice {
  std::string path;
  eventcamera::VideoDevice device;
};

/// The devices of Linux that capture video, /dev/video*.
std::vector<FoundDevice> find_video_devices();
