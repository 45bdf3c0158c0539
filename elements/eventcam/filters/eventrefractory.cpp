// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventrefractory
 * @title: eventrefractory
 * @short_description: gives pixels a refractory period
 *
 * Drops the events of each pixel that come within #GstEventRefractory:refractory-period of the last
 * one that was kept, as a pixel with this refractory period would. This thins bursts, and limits
 * the event rate of flickering and of hot pixels.
 *
 * The last event of each pixel is forgotten after a flush and where time goes back, and is kept
 * through gaps, new segments and DISCONT.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventrefractory
 * refractory-period=10000000 ! eventrender ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "gst/filter/eventfilter.hpp"
#include "src/filter/refractory_filter.hpp"

using namespace eventcamera;

DEFINE_EVENT_FILTER(GstEventRefractory, gst_event_refractory, EVENT_REFRACTORY,
                    EventFilterOf<RefractoryFilter>, eventrefractory)

static void gst_event_refractory_class_init(GstEventRefractoryClass* klass) {
  using Settings = RefractoryFilter::Settings;
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::refractory_period, "refractory-period",
                 "Minimum time between two events of a pixel (ns; 0 = keep all events)", 0,
                 max_filter_time);
  set_metadata(klass, "Refractory period", "Filter",
               "Drops events of a pixel that follow another too soon");
}
