// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventtrail
 * @title: eventtrail
 * @short_description: keeps one event of each burst
 *
 * Where an edge passes, a pixel fires a burst: several events of one polarity, each less than
 * #GstEventTrail:threshold after the one before. Keeps only a part of each burst, as the event
 * trail filter in Prophesee's sensors does:
 *
 * - `trail`: the first event, which has the most precise time;
 * - `stc-cut-trail`: the second event. Single events, mostly noise, are dropped;
 * - `stc-keep-trail`: all events but the first. Single events are dropped.
 *
 * The last event of each pixel is forgotten after a flush and where time goes back, and is kept
 * through gaps, new segments and DISCONT.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventtrail mode=stc-cut-trail !
 * eventrender ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "gst/base/types.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/trail_filter.hpp"

using eventcamera::TrailFilter;
using eventcamera::TrailMode;

DEFINE_EVENT_FILTER(GstEventTrail, gst_event_trail, EVENT_TRAIL, EventFilterOf<TrailFilter>,
                    eventtrail)

static GType mode_type() {
  static const GEnumValue values[] = {
      {static_cast<int>(TrailMode::trail), "Keep the first event of a burst", "trail"},
      {static_cast<int>(TrailMode::stc_cut_trail), "Keep the second event of a burst",
       "stc-cut-trail"},
      {static_cast<int>(TrailMode::stc_keep_trail), "Keep all events of a burst but the first",
       "stc-keep-trail"},
      {0, nullptr, nullptr},
  };
  return enum_type("GstEventTrailMode", values);
}

static void gst_event_trail_class_init(GstEventTrailClass* klass) {
  using Settings = TrailFilter::Settings;
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::mode,
                 g_param_spec_enum("mode", "Mode", "Part of a burst to keep", mode_type(),
                                   static_cast<int>(Settings().mode), mutable_playing_flags));
  properties.add(
      &Settings::threshold,
      g_param_spec_uint64("threshold", "Threshold",
                          "Time after an event at which a new burst begins (ns)", GST_MSECOND,
                          100 * GST_MSECOND, Settings().threshold, mutable_playing_flags));
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Event trail filter", "Filter",
                                        "Keeps one event of each burst of a pixel",
                                        EVENTSIM_AUTHORS);
}
