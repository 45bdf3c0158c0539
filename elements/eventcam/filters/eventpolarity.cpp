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

using eventcamera::PolarityFilter;
using Kept = PolarityFilter::Kept;

DEFINE_EVENT_FILTER(GstEventPolarity, gst_event_polarity, EVENT_POLARITY,
                    EventFilterOf<PolarityFilter>, eventpolarity)

static GType kept_type() {
  static const GEnumValue values[] = {
      {static_cast<int>(Kept::both), "Both", "both"},
      {static_cast<int>(Kept::on), "ON, brighter", "on"},
      {static_cast<int>(Kept::off), "OFF, darker", "off"},
      {0, nullptr, nullptr},
  };
  return enum_type("GstEventPolarityKept", values);
}

static void gst_event_polarity_class_init(GstEventPolarityClass* klass) {
  using Settings = PolarityFilter::Settings;
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::keep,
                 g_param_spec_enum("keep", "Keep", "Polarity of the events to keep", kept_type(),
                                   static_cast<int>(Settings().keep), mutable_playing_flags));
  properties.add(&Settings::invert, g_param_spec_boolean("invert", "Invert", "Swap ON and OFF",
                                                         FALSE, mutable_playing_flags));
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Event polarity", "Filter",
                                        "Keeps one polarity, or swaps both", EVENTSIM_AUTHORS);
}
