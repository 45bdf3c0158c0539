// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <utility>

#include "elements/eventcam/tensor/tensor_properties.hpp"
#include "gst/base/owned.hpp"

/// Format of the tensors of a sensor's events.
struct TensorFormat {
  TensorFormat(const GstEventCameraInfo& input, const TensorProperties& properties)
      : sensor(input), tensors(properties.of_tensors()), windows(properties.of_windows()) {}

  eventcamera::TensorShape shape() const { return {sensor.width, sensor.height, tensors}; }
  OwnedCaps caps() const;
  /// Time from the start of a window to its end, as far as it is known.
  GstClockTime latency() const;

  GstEventCameraInfo sensor;
  eventcamera::TensorSettings tensors;
  eventcamera::WindowSettings windows;

 private:
  std::pair<gint, gint> framerate() const;
};

/// Text: the fields in which `wanted` differs from fixed caps, and the properties to set.
std::string mismatch_text(GstCaps* wanted, GstCaps* made);
