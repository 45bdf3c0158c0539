// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/properties.hpp"

#include <gst/gst.h>

#include "gst/base/properties.hpp"
#include "gst/drawing/drawn_video.hpp"

namespace {

constexpr guint max_interpolated_frames = 255;

constexpr auto controllable_flags =
    static_cast<GParamFlags>(mutable_playing_flags | GST_PARAM_CONTROLLABLE);

}  // namespace

void install_thresholds(GObjectClass* klass, double grey_levels) {
  Properties<simulator_settings_of> properties(klass);
  properties.add(
      [](SimulatorSettings& settings) -> double& { return settings.simulation.positive_threshold; },
      g_param_spec_double("positive-threshold", "Positive threshold",
                          "Contrast threshold of ON events: brightness must rise by more than "
                          "this (8-bit grey levels at any bit depth)",
                          0, 255, grey_levels, controllable_flags));
  properties.add(
      [](SimulatorSettings& settings) -> double& { return settings.simulation.negative_threshold; },
      g_param_spec_double("negative-threshold", "Negative threshold",
                          "Contrast threshold of OFF events: brightness must fall by more than "
                          "this (8-bit grey levels at any bit depth, a magnitude)",
                          0, 255, grey_levels, controllable_flags));
}

void install_interpolated_frames(GObjectClass* klass) {
  Properties<simulator_settings_of>(klass).add(
      [](SimulatorSettings& settings) -> int& { return settings.simulation.interpolated_frames; },
      g_param_spec_uint("interpolated-frames", "Interpolated frames",
                        "Number of frames to interpolate between two frames of the video; "
                        "events take those frames' timestamps (at most one frame per microsecond)",
                        0, max_interpolated_frames,
                        static_cast<guint>(eventcamera::Settings().interpolated_frames),
                        mutable_playing_flags));
}

void install_label(GObjectClass* klass) {
  Properties<simulator_settings_of>(klass).add(
      [](SimulatorSettings& settings) -> bool& { return settings.simulation.labels; },
      g_param_spec_boolean("label", "Label",
                           "Label each event with its cause: light, leak, shot noise, hot pixel or "
                           "exposure pulse. Implied by the pad label_sink, which adds classes. "
                           "Events drawn as video have no labels",
                           FALSE, mutable_playing_flags));
}

static void install_settings(GObjectClass* klass) {
  Properties<simulator_settings_of> properties(klass);
  properties.add([](SimulatorSettings& settings) -> int& { return settings.simulation.threads; },
                 g_param_spec_uint("n-threads", "Threads",
                                   "Maximum number of threads (0 = one per processor); the events "
                                   "do not depend on it",
                                   0, G_MAXINT, 0, mutable_playing_flags));
  properties.add(
      &SimulatorSettings::palette,
      g_param_spec_enum("palette", "Palette", "Colours of event frames (accumulated-event video)",
                        palette_type(), static_cast<int>(SimulatorSettings().palette),
                        mutable_playing_flags));
}

/// Overrides the property `qos` of GstBaseTransform, whose default is off.
static void install_qos_properties(GObjectClass* klass) {
  Properties<simulator_qos_of> properties(klass);
  properties.add(
      [](SimulatorQos& qos, const GValue* value) { qos.enable(g_value_get_boolean(value)); },
      [](SimulatorQos& qos, GValue* value) { g_value_set_boolean(value, qos.is_enabled()); },
      g_param_spec_boolean("qos", "QoS",
                           "Skip whole frames, without processing them, if downstream is late; the "
                           "next interval is longer. By default on for events drawn as video, off "
                           "for events",
                           TRUE, mutable_playing_flags));
  install_stats(
      klass, [](GObject* object) { return simulator_qos_of(object).lock()->stats(); },
      "Counters since start: frames (processed), skipped-frames (due to qos), processing-time (of "
      "all processed frames, ns)");
}

void install_base_properties(GObjectClass* klass) {
  install_settings(klass);
  install_qos_properties(klass);
}
