// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/plugin.hpp"
#include "gst/simulator/eventsimulator.hpp"

const EventSimulatorTypeNames event_simulator_type_names = {.simulator = "GstEventSimulator",
                                                            .pool = "GstEventPool"};

#define ELEMENTS(X) \
  X(eventsim_frame) X(eventsim_dense) X(eventsim_sparse) X(eventsim_diff) X(eventsim_dvs)

EVENTSIM_PLUGIN(eventsim, "Simulators of event cameras: video to events", ELEMENTS,
                EVENTSIM_NO_TYPE_FINDERS)
