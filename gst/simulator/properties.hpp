// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <glib-object.h>

#include "gst/base/guarded.hpp"
#include "gst/simulator/qos.hpp"
#include "src/render/palette.hpp"
#include "src/simulate/simulator.hpp"

/// Properties that simulators have in common.

/// User-settable values, copied once per buffer.
struct SimulatorSettings {
  eventcamera::Settings simulation;
  eventcamera::PaletteName palette = eventcamera::PaletteName::dark;
};

// Of an element.
Guarded<SimulatorSettings>& simulator_settings_of(GObject* object);
Guarded<SimulatorQos>& simulator_qos_of(GObject* object);

// For class_init. Every simulator has the base properties: n-threads, palette, qos and stats.
void install_base_properties(GObjectClass* klass);
/// `grey_levels` is the default of both thresholds.
void install_thresholds(GObjectClass* klass, double grey_levels);
void install_interpolated_frames(GObjectClass* klass);
void install_label(GObjectClass* klass);
