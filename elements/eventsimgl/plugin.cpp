// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/plugin.hpp"
#include "gst/base/event_pool.hpp"
#include "gst/base/properties.hpp"
#include "gst/simulator/eventsimulator.hpp"

const char* const event_simulator_type_name = "GstGLEventSimulatorBase";
const char* const event_pool_type_name = "GstGLEventPool";

#define ELEMENTS(X) \
  X(gleventsim_frame) X(gleventsim_dense) X(gleventsim_sparse) X(gleventsim_diff) X(gleventsim_dvs)

EVENTSIM_PLUGIN(eventsimgl, "Simulators of event cameras on the GPU: video to events", ELEMENTS,
                EVENTSIM_NONE, EVENTSIM_NONE)
