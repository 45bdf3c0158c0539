// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/gst.h>

#include "elements/eventcam/aedatdemux.hpp"
#include "elements/eventcam/aedatmux.hpp"
#include "elements/eventcam/csvdec.hpp"
#include "elements/eventcam/csvenc.hpp"
#include "elements/eventcam/datdec.hpp"
#include "elements/eventcam/datenc.hpp"
#include "elements/eventcam/esdec.hpp"
#include "elements/eventcam/esenc.hpp"
#include "elements/eventcam/eventcompare.hpp"
#include "elements/eventcam/eventhdf5dec.hpp"
#include "elements/eventcam/eventhdf5sink.hpp"
#include "elements/eventcam/eventhdf5src.hpp"
#include "elements/eventcam/eventoverlay.hpp"
#include "elements/eventcam/eventrender.hpp"
#include "elements/eventcam/eventstats.hpp"
#include "elements/eventcam/evtdec.hpp"
#include "elements/eventcam/evtenc.hpp"
#include "elements/eventcam/npydec.hpp"
#include "elements/eventcam/npyenc.hpp"
#include "elements/eventcam/typefinders.hpp"

static gboolean plugin_init(GstPlugin* plugin) {
  gboolean registered = FALSE;
  registered |= GST_ELEMENT_REGISTER(aedatdemux, plugin);
  registered |= GST_ELEMENT_REGISTER(aedatmux, plugin);
  registered |= GST_ELEMENT_REGISTER(csvdec, plugin);
  registered |= GST_ELEMENT_REGISTER(csvenc, plugin);
  registered |= GST_ELEMENT_REGISTER(datdec, plugin);
  registered |= GST_ELEMENT_REGISTER(datenc, plugin);
  registered |= GST_ELEMENT_REGISTER(esdec, plugin);
  registered |= GST_ELEMENT_REGISTER(esenc, plugin);
  registered |= GST_ELEMENT_REGISTER(eventcompare, plugin);
  registered |= GST_ELEMENT_REGISTER(eventhdf5dec, plugin);
  registered |= GST_ELEMENT_REGISTER(eventhdf5sink, plugin);
  registered |= GST_ELEMENT_REGISTER(eventhdf5src, plugin);
  registered |= GST_ELEMENT_REGISTER(eventoverlay, plugin);
  registered |= GST_ELEMENT_REGISTER(eventrender, plugin);
  registered |= GST_ELEMENT_REGISTER(eventstats, plugin);
  registered |= GST_ELEMENT_REGISTER(evtdec, plugin);
  registered |= GST_ELEMENT_REGISTER(evtenc, plugin);
  registered |= GST_ELEMENT_REGISTER(npydec, plugin);
  registered |= GST_ELEMENT_REGISTER(npyenc, plugin);
  registered |= GST_TYPE_FIND_REGISTER(aedat, plugin);
  registered |= GST_TYPE_FIND_REGISTER(eventcsv, plugin);
  registered |= GST_TYPE_FIND_REGISTER(eventstream, plugin);
  registered |= GST_TYPE_FIND_REGISTER(hdf5, plugin);
  registered |= GST_TYPE_FIND_REGISTER(npy, plugin);
  registered |= GST_TYPE_FIND_REGISTER(propheseedat, plugin);
  registered |= GST_TYPE_FIND_REGISTER(propheseeraw, plugin);
  return registered;
}

#define PACKAGE "gst-eventsim"
GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, eventcam,
                  "Event streams: render, read, write, measure", plugin_init, PACKAGE_VERSION,
                  "LGPL", "gst-eventsim", "Unknown package origin")
