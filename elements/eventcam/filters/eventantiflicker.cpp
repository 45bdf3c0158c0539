// SPDX-License-Identifier: LGPL-2.1-or-later
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
#include "gst/base/types.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/flicker_filter.hpp"

using namespace eventcamera;

DEFINE_EVENT_FILTER(GstEventAntiFlicker, gst_event_anti_flicker, EVENT_ANTI_FLICKER,
                    EventFilterOf<FlickerFilter>, eventantiflicker)

static void gst_event_anti_flicker_class_init(GstEventAntiFlickerClass* klass) {
  using Settings = FlickerFilter::Settings;
  constexpr guint min_frequency = 50;
  constexpr guint max_frequency = 520;
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
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
