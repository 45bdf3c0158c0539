// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/gst.h>

#include "elements/eventsim/eventsimdense.hpp"
#include "elements/eventsim/eventsimdiff.hpp"
#include "elements/eventsim/eventsimdvs.hpp"
#include "elements/eventsim/eventsimframe.hpp"
#include "elements/eventsim/eventsimsparse.hpp"

static gboolean plugin_init(GstPlugin* plugin) {
  gboolean registered = FALSE;
  registered |= GST_ELEMENT_REGISTER(eventsim_frame, plugin);
  registered |= GST_ELEMENT_REGISTER(eventsim_dense, plugin);
  registered |= GST_ELEMENT_REGISTER(eventsim_sparse, plugin);
  registered |= GST_ELEMENT_REGISTER(eventsim_diff, plugin);
  registered |= GST_ELEMENT_REGISTER(eventsim_dvs, plugin);
  return registered;
}

#define PACKAGE "gst-eventsim"
GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, eventsim,
                  "Simulators of event cameras: video to events", plugin_init, PACKAGE_VERSION,
                  "LGPL", "gst-eventsim", "Unknown package origin")
