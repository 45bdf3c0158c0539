// SPDX-License-Identifier: LGPL-2.1-or-later
/// Elements that need only a filter of src/filter and its properties.
#include "gst/base/element_type.hpp"
#include "gst/base/properties.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/denoise_filter.hpp"
#include "src/filter/flicker_filter.hpp"
#include "src/filter/polarity_filter.hpp"
#include "src/filter/rate_filter.hpp"
#include "src/filter/refractory_filter.hpp"
#include "src/filter/trail_filter.hpp"

using namespace eventcamera;

/**
 * SECTION:element-eventantiflicker
 * @title: eventantiflicker
 * @short_description: drops the events of flickering lamps
 *
 * Finds pixels that flicker: whose polarity changes again and again with a frequency from
 * #GstEventAntiFlicker:min-frequency to #GstEventAntiFlicker:max-frequency. Drops their events, or
 * with #GstEventAntiFlicker:mode `band-pass` all others. Lamps on the mains flicker with twice its
 * frequency: 100 or 120 Hz.
 *
 * A phase of a pixel lasts from its first event of one polarity to its first of the other. Each
 * pixel counts phases, from 0 to 7: one more for each whose length fits a period in the band and
 * #GstEventAntiFlicker:duty-cycle, one less for each that does not, and none after the longest
 * period without a change. Flicker starts when the count reaches
 * #GstEventAntiFlicker:start-threshold, and stops when it falls below
 * #GstEventAntiFlicker:stop-threshold.
 *
 * The counts are forgotten after a flush and where time goes back, and are kept through gaps, new
 * segments and DISCONT.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventantiflicker min-frequency=90
 * max-frequency=130 ! eventrender ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
DEFINE_EVENT_FILTER(GstEventAntiFlicker, gst_event_anti_flicker, EVENT_ANTI_FLICKER,
                    EventFilterOf<FlickerFilter>, eventantiflicker)

static void gst_event_anti_flicker_class_init(GstEventAntiFlickerClass* klass) {
  using Settings = FlickerFilter::Settings;
  constexpr guint min_frequency = 50;
  constexpr guint max_frequency = 520;
  Properties<gst_event_anti_flicker_settings> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::mode, "mode", "Drop flicker, or keep only flicker",
                 enum_type<FlickerMode>(
                     "GstEventAntiFlickerMode",
                     {{FlickerMode::band_stop, "Drop flicker in the band", "band-stop"},
                      {FlickerMode::band_pass, "Keep only flicker in the band", "band-pass"}}));
  properties.add(&Settings::min_frequency, "min-frequency", "Lower end of the band of flicker (Hz)",
                 min_frequency, max_frequency);
  properties.add(&Settings::max_frequency, "max-frequency",
                 "Upper end of the band of flicker (Hz); raised to min-frequency if lower",
                 min_frequency, max_frequency);
  properties.add(&Settings::duty_cycle, "duty-cycle",
                 "Share of a period from the first ON event to the first OFF event", 0.01, 0.99);
  properties.add(&Settings::start_threshold, "start-threshold",
                 "Count of phases at which a pixel begins to flicker", 1,
                 FlickerFilter::max_threshold);
  properties.add(&Settings::stop_threshold, "stop-threshold",
                 "Count of phases below which a pixel no longer flickers; lowered to "
                 "start-threshold if higher",
                 1, FlickerFilter::max_threshold);
  set_metadata(klass, "Anti-flicker filter", "Filter", "Drops the events of flickering lamps");
}

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
 *   36 that were dropped, is at most #GstEventDenoise:search-distance away.
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
DEFINE_EVENT_FILTER(GstEventDenoise, gst_event_denoise, EVENT_DENOISE, EventFilterOf<DenoiseFilter>,
                    eventdenoise)

static void gst_event_denoise_class_init(GstEventDenoiseClass* klass) {
  using Settings = DenoiseFilter::Settings;
  Properties<gst_event_denoise_settings> properties(G_OBJECT_CLASS(klass));
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
using Kept = PolarityFilter::Kept;

DEFINE_EVENT_FILTER(GstEventPolarity, gst_event_polarity, EVENT_POLARITY,
                    EventFilterOf<PolarityFilter>, eventpolarity)

static void gst_event_polarity_class_init(GstEventPolarityClass* klass) {
  using Settings = PolarityFilter::Settings;
  Properties<gst_event_polarity_settings> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::keep, "keep", "Polarity of the events to keep",
                 enum_type<Kept>("GstEventPolarityKept", {{Kept::both, "Both", "both"},
                                                          {Kept::on, "ON, brighter", "on"},
                                                          {Kept::off, "OFF, darker", "off"}}));
  properties.add(&Settings::invert, "invert", "Swap ON and OFF");
  set_metadata(klass, "Event polarity", "Filter", "Keeps one polarity, or swaps both");
}

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
DEFINE_EVENT_FILTER(GstEventRateControl, gst_event_rate_control, EVENT_RATE_CONTROL,
                    EventFilterOf<RateFilter>, eventratecontrol)

static void gst_event_rate_control_class_init(GstEventRateControlClass* klass) {
  using Settings = RateFilter::Settings;
  Properties<gst_event_rate_control_settings> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::max_rate, "max-rate", "Limit of events per second (0 = no limit)", 0,
                 G_GUINT64_CONSTANT(1'000'000'000'000));
  properties.add(&Settings::reference_period, "reference-period",
                 "Time over which events are counted (ns)", 10 * GST_USECOND, GST_SECOND);
  set_metadata(klass, "Event rate control", "Filter", "Limits the event rate");
}

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
DEFINE_EVENT_FILTER(GstEventRefractory, gst_event_refractory, EVENT_REFRACTORY,
                    EventFilterOf<RefractoryFilter>, eventrefractory)

static void gst_event_refractory_class_init(GstEventRefractoryClass* klass) {
  using Settings = RefractoryFilter::Settings;
  Properties<gst_event_refractory_settings> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::refractory_period, "refractory-period",
                 "Minimum time between two events of a pixel (ns; 0 = keep all events)", 0,
                 max_filter_time);
  set_metadata(klass, "Refractory period", "Filter",
               "Drops events of a pixel that follow another too soon");
}

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
DEFINE_EVENT_FILTER(GstEventTrail, gst_event_trail, EVENT_TRAIL, EventFilterOf<TrailFilter>,
                    eventtrail)

static void gst_event_trail_class_init(GstEventTrailClass* klass) {
  using Settings = TrailFilter::Settings;
  Properties<gst_event_trail_settings> properties(G_OBJECT_CLASS(klass));
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
