// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventpolarity
 * @title: eventpolarity
 * @short_description: keeps one polarity, or exchanges both
 *
 * Keeps the ON or the OFF events, and with #GstEventPolarity:invert exchanges ON and OFF of those
 * that are kept.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventpolarity keep=on ! eventrender !
 * videoconvert ! autovideosink
 * ]|
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
  properties.add(
      &Settings::keep,
      g_param_spec_enum("keep", "Keep", "Polarity of the events that are kept", kept_type(),
                        static_cast<int>(Settings().keep), mutable_playing_flags));
  properties.add(&Settings::invert,
                 g_param_spec_boolean("invert", "Invert", "Whether ON becomes OFF, and OFF ON",
                                      FALSE, mutable_playing_flags));
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Event polarity", "Filter",
                                        "Keeps one polarity, or exchanges both", EVENTSIM_AUTHORS);
}
