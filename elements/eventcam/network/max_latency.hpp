// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "gst/base/properties.hpp"

/// Settings of payloaders, which hold events to fill packets.
struct PayloaderSettings {
  GstClockTime max_latency = 5 * GST_MSECOND;
};

/// Adds the property max-latency. Settings are derived from PayloaderSettings.
template <auto settings_of>
void add_max_latency(Properties<settings_of>& properties) {
  properties.add(
      &PayloaderSettings::max_latency,
      g_param_spec_uint64("max-latency", "Maximum latency",
                          "Maximum time for which an event waits for others to fill its packet "
                          "(ns; 0 = send each buffer at once)",
                          0, GST_SECOND, PayloaderSettings().max_latency, mutable_playing_flags));
}
