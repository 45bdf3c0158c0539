// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/types.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/simulate/warp.hpp"

/// Properties of the simulators that interpolate frames with dense optical flow.

inline constexpr auto dense_property_flags = static_cast<GParamFlags>(
    G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);

inline constexpr GEnumValue farneback_flow = {static_cast<int>(eventcamera::FlowMethod::farneback),
                                              "Farneback", "farneback"};

/// `type` is that of the methods that an element has.
inline GParamSpec* flow_property(GType type, eventcamera::FlowMethod method) {
  return g_param_spec_enum("flow", "Flow", "Method of finding the motion between frames", type,
                           static_cast<int>(method), dense_property_flags);
}

inline GParamSpec* interpolation_property(eventcamera::Interpolation interpolation) {
  using eventcamera::Interpolation;
  static const GEnumValue values[] = {
      {static_cast<int>(Interpolation::forward), "The earlier frame, moved along the flow",
       "forward"},
      {static_cast<int>(Interpolation::blend),
       "The earlier frame moved forward and the later frame moved back, blended", "blend"},
      {0, nullptr, nullptr},
  };
  return g_param_spec_enum("interpolation", "Interpolation", "Method of interpolating frames",
                           enum_type("GstEventSimInterpolation", values),
                           static_cast<int>(interpolation), dense_property_flags);
}
