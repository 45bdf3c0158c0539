// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventratecontrol
 * @title: eventratecontrol
 * @short_description: limits the event rate
 *
 * Limits the event rate to #GstEventRateControl:max-rate by keeping every n-th event, so the kept
 * events are spread over the picture and over time. n follows from the number of events in the last
 * #GstEventRateControl:reference-period, or in the current one if it already has more. The first
 * period of a flood keeps up to half more than its share; the next ones compensate, so the average
 * is at most #GstEventRateControl:max-rate. If events come in bursts, as from simulators that put
 * all events of a frame at one time, set the reference period to at least the time between bursts.
 *
 * Adds no latency. The property `stats` counts the dropped events. A flush resets the rate, as does
 * time that goes back; gaps, new segments and DISCONT do not.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventratecontrol max-rate=1000000 !
 * eventrender ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "gst/filter/eventfilter.hpp"
#include "src/filter/rate_filter.hpp"

using namespace eventcamera;

DEFINE_EVENT_FILTER(GstEventRateControl, gst_event_rate_control, EVENT_RATE_CONTROL,
                    EventFilterOf<RateFilter>, eventratecontrol)

static void gst_event_rate_control_class_init(GstEventRateControlClass* klass) {
  using Settings = RateFilter::Settings;
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::max_rate, "max-rate", "Limit of events per second (0 = no limit)", 0,
                 G_GUINT64_CONSTANT(1'000'000'000'000));
  properties.add(&Settings::reference_period, "reference-period",
                 "Time over which events are counted (ns)", 10 * GST_USECOND, GST_SECOND);
  set_metadata(klass, "Event rate control", "Filter", "Limits the event rate");
}
