// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/plugin.hpp"
#include "gst/base/event_pool.hpp"
#include "gst/base/properties.hpp"
#include "gst/simulator/eventsimulator.hpp"

const char* const event_simulator_type_name = "GstEventSimulator";
const char* const event_pool_type_name = "GstEventPool";

#define ELEMENTS(X) \
  X(eventsim_frame) X(eventsim_dense) X(eventsim_sparse) X(eventsim_diff) X(eventsim_dvs)

EVENTSIM_PLUGIN(eventsim, "Simulators of event cameras: video to events", ELEMENTS, EVENTSIM_NONE,
                EVENTSIM_NONE)
