// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/plugin.hpp"
#include "features.hpp"
#include "gst/base/event_pool.hpp"

const char* const event_pool_type_name = "GstRecordedEventPool";

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
#define NPZ_ELEMENTS(X) X(eventnpzdec) X(eventnpzenc)
#else
#define NPZ_ELEMENTS(X)
#endif

#ifdef HAVE_ROS
#define ROS_ELEMENTS(X) X(eventbagdemux) X(eventmcapdemux) X(eventmcapenc)
#else
#define ROS_ELEMENTS(X)
#endif

#ifdef HAVE_V4L2
#define PROVIDERS(X) X(eventcameraprovider)
#else
#define PROVIDERS EVENTSIM_NONE
#endif

// clang-format off
#define ELEMENTS(X)                                                                        \
  AEDAT_ELEMENTS(X) HDF5_ELEMENTS(X) NPZ_ELEMENTS(X) ROS_ELEMENTS(X)                       \
  X(eventcompare) X(eventfuse) X(eventmerge) X(eventoverlay) X(eventreconstruct)           \
  X(eventrender) X(eventstats)                                                             \
  X(eventatisdec) X(eventcsvdec) X(eventcsvenc) X(eventdatdec) X(eventdatenc) X(eventesdec) X(eventesenc)  \
  X(eventantiflicker) X(eventdenoise) X(eventhotpixel) X(eventratecontrol)                 \
  X(eventcrop) X(eventcut) X(eventflip) X(eventmask) X(eventpolarity) X(eventscale) X(eventundistort)  \
  X(eventlabel) X(eventrefractory) X(eventtensor) X(eventtrail) X(flowjoin)                \
  X(eventdatagramdepay) X(eventdatagrampay)                                                \
  X(eventnpydec) X(eventnpyenc) X(evtdec) X(evtenc) X(evtparse) X(rtpeventdepay) X(rtpeventpay)
// clang-format on

#define TYPE_FINDERS(X) X(event_files)

EVENTSIM_PLUGIN(eventcam,
                "Event streams: read, write, filter, merge, draw, measure and send events",
                ELEMENTS, TYPE_FINDERS, PROVIDERS)
