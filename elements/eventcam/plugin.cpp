// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/gst.h>

#include "gst/base/authors.hpp"

#ifdef HAVE_AEDAT
#define AEDAT_ELEMENTS(X) X(aedatdemux) X(aedatmux)
#else
#define AEDAT_ELEMENTS(X)
#endif

#ifdef HAVE_HDF5
#define HDF5_ELEMENTS(X) X(eventhdf5dec) X(eventhdf5sink)
#else
#define HDF5_ELEMENTS(X)
#endif

#ifdef HAVE_NPZ
#define NPZ_ELEMENTS(X) X(eventnpzdec)
#else
#define NPZ_ELEMENTS(X)
#endif

// clang-format off
#define ELEMENTS(X)                                                                        \
  AEDAT_ELEMENTS(X) HDF5_ELEMENTS(X) NPZ_ELEMENTS(X)                                       \
  X(eventcompare) X(eventoverlay) X(eventrender) X(eventstats)                             \
  X(eventcsvdec) X(eventcsvenc) X(eventdatdec) X(eventdatenc) X(eventesdec) X(eventesenc)  \
  X(eventdatagramdepay) X(eventdatagrampay)                                                \
  X(eventnpydec) X(eventnpyenc) X(evtdec) X(evtenc) X(rtpeventdepay) X(rtpeventpay)
// clang-format on
#define TYPE_FINDERS(X) \
  X(aedat) X(eventcsv) X(eventstream) X(hdf5) X(npy) X(npz) X(propheseedat) X(propheseeraw)

#define DECLARE_ELEMENT(name) GST_ELEMENT_REGISTER_DECLARE(name)
#define DECLARE_TYPE_FINDER(name) GST_TYPE_FIND_REGISTER_DECLARE(name)
G_BEGIN_DECLS
ELEMENTS(DECLARE_ELEMENT)
TYPE_FINDERS(DECLARE_TYPE_FINDER)
G_END_DECLS

static gboolean plugin_init(GstPlugin* plugin) {
  gboolean registered = FALSE;
#define REGISTER_ELEMENT(name) registered |= GST_ELEMENT_REGISTER(name, plugin);
#define REGISTER_TYPE_FINDER(name) registered |= GST_TYPE_FIND_REGISTER(name, plugin);
  ELEMENTS(REGISTER_ELEMENT)
  TYPE_FINDERS(REGISTER_TYPE_FINDER)
  return registered;
}

#define PACKAGE "gst-eventsim"
GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, eventcam,
                  "Event streams: render, read, write, send, measure", plugin_init, PACKAGE_VERSION,
                  "LGPL", "gst-eventsim", EVENTSIM_AUTHORS)
