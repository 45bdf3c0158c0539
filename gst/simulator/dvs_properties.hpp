// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <glib-object.h>

#include <memory>
#include <string>

#include "src/dvs/dvs_settings.hpp"

/// Properties of the simulators of the physical pixel, for EventSimulatorMethod: make_settings,
/// install_properties and fault.
std::shared_ptr<void> make_dvs_settings();
void install_dvs_properties(GObjectClass* klass);
std::string fault_of_profile(GObject* object);

eventcamera::DvsSettings dvs_settings_of(GObject* object);
