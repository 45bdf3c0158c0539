// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventratecontrol
 * @title: eventratecontrol
 * @short_description: limits the event rate
 *
 * Drops events where more than #GstEventRateControl:max-rate arrive. Every n-th event is kept, so
 * what is left is spread over the picture and over time. n follows from the events of the last
 * #GstEventRateControl:reference-period, or of this one if there are already more. The first period
 * of a flood keeps up to half more than its share; the next ones pay back, so the average is at
 * most #GstEventRateControl:max-rate. Where events come in bursts, as from simulators that put all
 * events of a frame at one time, the reference period should be at least the time between bursts.
 *
 * Nothing is delayed. The property `stats` counts what was dropped. The rate is forgotten after a
 * flush and where time goes back, and is kept through gaps, new segments and DISCONT.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventratecontrol max-rate=1000000 !
 * eventrender ! videoconvert ! autovideosink
 * ]|
 */
#include "gst/filter/eventfilter.hpp"
#include "src/filter/rate_filter.hpp"

using eventcamera::RateFilter;

DEFINE_EVENT_FILTER(GstEventRateControl, gst_event_rate_control, EVENT_RATE_CONTROL,
                    EventFilterOf<RateFilter>, eventratecontrol)

static void gst_event_rate_control_class_init(GstEventRateControlClass* klass) {
  using Settings = RateFilter::Settings;
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  properties.add(
      &Settings::max_rate,
      g_param_spec_uint64("max-rate", "Maximum rate", "Limit of events per second (0 = no limit)",
                          0, G_GUINT64_CONSTANT(1'000'000'000'000), Settings().max_rate,
                          mutable_playing_flags));
  properties.add(
      &Settings::reference_period,
      g_param_spec_uint64("reference-period", "Reference period",
                          "Time over which events are counted (ns)", 10 * GST_USECOND, GST_SECOND,
                          Settings().reference_period, mutable_playing_flags));
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Event rate control", "Filter",
                                        "Limits the event rate", EVENTSIM_AUTHORS);
}
