// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventdenoise
 * @title: eventdenoise
 * @short_description: drops noise
 *
 * Drops events that have too little support by earlier events near them, with one of several
 * published methods. Neighbours of a pixel are those around it, without itself.
 *
 * - `baf`, background activity filter: one of 8 neighbours fired within
 *   #GstEventDenoise:correlation-time, 2 ms by default;
 * - `stcf`, spatio-temporal correlation filter: at least #GstEventDenoise:min-neighbours of 8
 *   fired within 25 ms by default;
 * - `time-kernel`: each of 24 neighbours supports the event with 1 - Δt / τ, where Δt is the time
 *   since its last event of equal polarity, and τ the correlation time, 32 ms by default; the sum
 *   is at least #GstEventDenoise:threshold;
 * - `dwf`, double window filter: at least one of the last 36 events that were kept, or of the last
 * 36 that were dropped, is at most #GstEventDenoise:search-distance away.
 *
 * Compared in docs/filters.md. The state of the pixels is reset by a flush, by time that goes back,
 * and if another method or #GstEventDenoise:match-polarity is set; it is kept through gaps, new
 * segments and DISCONT.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventdenoise method=stcf ! eventrender !
 * videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "gst/base/types.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/denoise_filter.hpp"

using namespace eventcamera;

DEFINE_EVENT_FILTER(GstEventDenoise, gst_event_denoise, EVENT_DENOISE, EventFilterOf<DenoiseFilter>,
                    eventdenoise)

static void gst_event_denoise_class_init(GstEventDenoiseClass* klass) {
  using Settings = DenoiseFilter::Settings;
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  properties.add(
      &Settings::method, "method", "Denoising method",
      enum_type<DenoiseMethod>(
          "GstEventDenoiseMethod",
          {{DenoiseMethod::baf, "Background activity filter: one neighbour", "baf"},
           {DenoiseMethod::stcf, "Spatio-temporal correlation filter: several neighbours", "stcf"},
           {DenoiseMethod::time_kernel, "Time kernel: recent neighbours of equal polarity",
            "time-kernel"},
           {DenoiseMethod::dwf, "Double window filter: near one of the last events", "dwf"}}));
  properties.add(
      &Settings::correlation_time, "correlation-time",
      "Maximum time between events that support each other (ns; 0 = the default of the method)", 0,
      DenoiseFilter::max_correlation_time);
  properties.add(&Settings::min_neighbours, "min-neighbours",
                 "Minimum number of supporting neighbours (stcf)", 1, 8);
  properties.add(&Settings::match_polarity, "match-polarity",
                 "Require support by events of equal polarity (baf, stcf)");
  properties.add(&Settings::threshold, "threshold", "Minimum support by neighbours (time-kernel)",
                 0, 24);
  properties.add(&Settings::search_distance, "search-distance",
                 "Maximum distance of a supporting event, across plus down (pixels; dwf)", 0, 100);
  set_metadata(klass, "Event denoiser", "Filter", "Drops events that are noise");
}
