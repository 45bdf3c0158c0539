// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>

#include <memory>
#include <optional>

#include "gst/base/properties.hpp"
#include "src/simulate/simulator.hpp"

/// A method of simulation, for an element: video in, events or accumulated-event video out.
///
/// N frames give N - 1 intervals; the first frame after start, flush or a discontinuity is the one
/// that the next is compared to. An interval has the PTS of its first frame and comes out with its
/// last, so the latency is one frame. In the event stream an interval without events is a GAP.
struct EventSimulatorMethod {
  const char* type_name;
  const char* long_name;
  const char* description;
  /// Default of positive-threshold and negative-threshold, grey levels; without, the element has
  /// no such properties.
  std::optional<double> threshold;
  bool interpolates = false;  ///< has the property interpolated-frames

  /// Makes the simulator for frames of this format. May throw.
  std::unique_ptr<eventcamera::Simulator> (*create)(const eventcamera::LumaFormat& format);

  /// A method with properties of its own makes a GuardedSettings, installs the properties, and
  /// gives the settings to its simulator before each frame. May be null.
  std::shared_ptr<void> (*make_settings)() = nullptr;
  void (*install_properties)(GObjectClass* klass) = nullptr;
  void (*configure)(eventcamera::Simulator& simulator, GObject* object) = nullptr;
};

/// The type of the elements of a method, which lives as long as the process.
GType event_simulator_type(const EventSimulatorMethod& method);

/// What make_settings() has made for an element.
void* event_simulator_settings(GObject* object);

template <class Settings>
GuardedSettings<Settings>& event_simulator_settings(GObject* object) {
  return *static_cast<GuardedSettings<Settings>*>(event_simulator_settings(object));
}
