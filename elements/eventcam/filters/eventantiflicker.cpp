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

using eventcamera::FlickerFilter;
using eventcamera::FlickerMode;

DEFINE_EVENT_FILTER(GstEventAntiFlicker, gst_event_anti_flicker, EVENT_ANTI_FLICKER,
                    EventFilterOf<FlickerFilter>, eventantiflicker)

static GType mode_type() {
  static const GEnumValue values[] = {
      {static_cast<int>(FlickerMode::band_stop), "Drop flicker in the band", "band-stop"},
      {static_cast<int>(FlickerMode::band_pass), "Keep only flicker in the band", "band-pass"},
      {0, nullptr, nullptr},
  };
  return enum_type("GstEventAntiFlickerMode", values);
}

static void gst_event_anti_flicker_class_init(GstEventAntiFlickerClass* klass) {
  using Settings = FlickerFilter::Settings;
  constexpr guint min_frequency = 50;
  constexpr guint max_frequency = 520;
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  properties.add(
      &Settings::mode,
      g_param_spec_enum("mode", "Mode", "Drop flicker, or keep only flicker", mode_type(),
                        static_cast<int>(Settings().mode), mutable_playing_flags));
  properties.add(&Settings::min_frequency,
                 g_param_spec_uint("min-frequency", "Minimum frequency",
                                   "Lower end of the band of flicker (Hz)", min_frequency,
                                   max_frequency, Settings().min_frequency, mutable_playing_flags));
  properties.add(&Settings::max_frequency,
                 g_param_spec_uint("max-frequency", "Maximum frequency",
                                   "Upper end of the band of flicker (Hz); raised to "
                                   "min-frequency if lower",
                                   min_frequency, max_frequency, Settings().max_frequency,
                                   mutable_playing_flags));
  properties.add(&Settings::duty_cycle,
                 g_param_spec_double("duty-cycle", "Duty cycle",
                                     "Share of a period from the first ON event to the first OFF "
                                     "event",
                                     0.01, 0.99, Settings().duty_cycle, mutable_playing_flags));
  properties.add(&Settings::start_threshold,
                 g_param_spec_uint("start-threshold", "Start threshold",
                                   "Count of phases at which a pixel begins to flicker", 1,
                                   FlickerFilter::max_threshold, Settings().start_threshold,
                                   mutable_playing_flags));
  properties.add(
      &Settings::stop_threshold,
      g_param_spec_uint("stop-threshold", "Stop threshold",
                        "Count of phases below which a pixel no longer flickers; lowered to "
                        "start-threshold if higher",
                        1, FlickerFilter::max_threshold, Settings().stop_threshold,
                        mutable_playing_flags));
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Anti-flicker filter", "Filter",
                                        "Drops the events of flickering lamps", EVENTSIM_AUTHORS);
}
