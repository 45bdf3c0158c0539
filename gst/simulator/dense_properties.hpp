// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "gst/base/element_type.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/properties.hpp"
#include "gst/simulator/eventsimulator.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/simulate/warp.hpp"

/// Properties of the simulators that interpolate frames with dense optical flow.

inline constexpr Choice<eventcamera::FlowMethod> farneback_flow = {
    eventcamera::FlowMethod::farneback, "Farneback", "farneback"};

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
    using eventcamera::Interpolation;
    Properties<of> properties(klass);
    properties.add(&DenseSettings::flow, "flow",
                   "Optical flow method, for the motion between frames", flows);
    properties.add(
        &DenseSettings::interpolation, "interpolation", "Frame interpolation method",
        enum_type<Interpolation>(
            "GstEventSimInterpolation",
            {{Interpolation::forward, "The earlier frame, moved along the flow", "forward"},
             {Interpolation::blend,
              "The earlier frame moved forward and the later frame moved back, blended",
              "blend"}}));
  }
};
