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

using namespace eventcamera;

DEFINE_EVENT_FILTER(GstEventTrail, gst_event_trail, EVENT_TRAIL, EventFilterOf<TrailFilter>,
                    eventtrail)

static void gst_event_trail_class_init(GstEventTrailClass* klass) {
  using Settings = TrailFilter::Settings;
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  properties.add(
      &Settings::mode, "mode", "Part of a burst to keep",
      enum_type<TrailMode>(
          "GstEventTrailMode",
          {{TrailMode::trail, "Keep the first event of a burst", "trail"},
           {TrailMode::stc_cut_trail, "Keep the second event of a burst", "stc-cut-trail"},
           {TrailMode::stc_keep_trail, "Keep all events of a burst but the first",
            "stc-keep-trail"}}));
  properties.add(&Settings::threshold, "threshold",
                 "Time after an event at which a new burst begins (ns)", GST_MSECOND,
                 100 * GST_MSECOND);
  set_metadata(klass, "Event trail filter", "Filter", "Keeps one event of each burst of a pixel");
}
