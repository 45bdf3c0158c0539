// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventpolarity
 * @title: eventpolarity
 * @short_description: keeps one polarity, or swaps both
 *
 * Keeps ON events, OFF events or both, and with #GstEventPolarity:invert swaps the polarity of the
 * kept events.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventpolarity keep=on ! eventrender !
 * videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "gst/base/types.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/polarity_filter.hpp"

using namespace eventcamera;
using Kept = PolarityFilter::Kept;

DEFINE_EVENT_FILTER(GstEventPolarity, gst_event_polarity, EVENT_POLARITY,
                    EventFilterOf<PolarityFilter>, eventpolarity)

static void gst_event_polarity_class_init(GstEventPolarityClass* klass) {
  using Settings = PolarityFilter::Settings;
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::keep, "keep", "Polarity of the events to keep",
                 enum_type<Kept>("GstEventPolarityKept", {{Kept::both, "Both", "both"},
                                                          {Kept::on, "ON, brighter", "on"},
                                                          {Kept::off, "OFF, darker", "off"}}));
  properties.add(&Settings::invert, "invert", "Swap ON and OFF");
  set_metadata(klass, "Event polarity", "Filter", "Keeps one polarity, or swaps both");
}
