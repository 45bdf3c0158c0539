// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/gst.h>

#include "gst/base/authors.hpp"
#include "gst/base/eventsimulator.hpp"

const EventSimulatorTypeNames event_simulator_type_names = {.simulator = "GstGLEventSimulatorBase",
                                                            .pool = "GstGLEventPool"};

#define ELEMENTS(X) X(gleventsim_frame) X(gleventsim_sparse) X(gleventsim_diff)

#define DECLARE(name) GST_ELEMENT_REGISTER_DECLARE(name)
G_BEGIN_DECLS
ELEMENTS(DECLARE)
G_END_DECLS

static gboolean plugin_init(GstPlugin* plugin) {
  gboolean registered = FALSE;
#define REGISTER(name) registered |= GST_ELEMENT_REGISTER(name, plugin);
  ELEMENTS(REGISTER)
  return registered;
}

#define PACKAGE "gst-eventsim"
GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, eventsimgl,
                  "Simulators of event cameras on the GPU: video to events", plugin_init,
                  PACKAGE_VERSION, "LGPL", "gst-eventsim", EVENTSIM_AUTHORS)
