// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "gst/base/types.hpp"
#include "gst/simulator/eventsimulator.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/simulate/warp.hpp"

/// Properties of the simulators that interpolate frames with dense optical flow.

inline constexpr GEnumValue farneback_flow = {static_cast<int>(eventcamera::FlowMethod::farneback),
                                              "Farneback", "farneback"};

inline GParamSpec* interpolation_property(eventcamera::Interpolation interpolation) {
  using eventcamera::Interpolation;
  static const GEnumValue values[] = {
      {static_cast<int>(Interpolation::forward), "The earlier frame, moved along the flow",
       "forward"},
      {static_cast<int>(Interpolation::blend),
       "The earlier frame moved forward and the later frame moved back, blended", "blend"},
      {0, nullptr, nullptr},
  };
  return g_param_spec_enum("interpolation", "Interpolation", "Frame interpolation method",
                           enum_type("GstEventSimInterpolation", values),
                           static_cast<int>(interpolation), mutable_playing_flags);
}

/// Settings of such a simulator. `method` is the default.
template <eventcamera::FlowMethod method>
struct DenseSettings {
  eventcamera::FlowMethod flow = method;
  eventcamera::Interpolation interpolation = eventcamera::Interpolation::forward;

  static std::shared_ptr<void> make() { return std::make_shared<Guarded<DenseSettings>>(); }

  static Guarded<DenseSettings>& of(GObject* object) {
    return event_simulator_settings<DenseSettings>(object);
  }

  /// `flows` is the enum type of the methods that the element supports.
  static void install(GObjectClass* klass, GType flows) {
    const DenseSettings defaults;
    Properties<of> properties(klass);
    properties.add(
        &DenseSettings::flow,
        g_param_spec_enum("flow", "Flow", "Optical flow method, for the motion between frames",
                          flows, static_cast<int>(defaults.flow), mutable_playing_flags));
    properties.add(&DenseSettings::interpolation, interpolation_property(defaults.interpolation));
  }
};
