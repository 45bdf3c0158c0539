// SPDX-License-Identifier: LGPL-2.1-or-later
// Shared by the RTP elements.
#pragma once

#include <gst/gst.h>

#include <array>

#include "src/wire/rtp_payload.hpp"

#define RTP_EVENT_CAPS                                                            \
  "application/x-rtp, media = (string) application, clock-rate = (int) 1000000, " \
  "encoding-name = (string) X-EVENT-CAMERA"

inline constexpr guint rtp_clock_rate = 1'000'000;

/// Names of RtpEventFormat in caps.
inline constexpr std::array rtp_event_formats = {"EVT3", "XYTP"};

/// Returns the property `stats` of the RTP base class, which the subclass overrides. The caller
/// owns it.
inline GstStructure* base_rtp_stats(GObject* object, GType base) {
  auto* klass = G_OBJECT_CLASS(g_type_class_peek(base));
  GParamSpec* spec = g_object_class_find_property(klass, "stats");
  GValue value = G_VALUE_INIT;
  g_value_init(&value, GST_TYPE_STRUCTURE);
  klass->get_property(object, spec->param_id, &value, spec);
  auto* stats = static_cast<GstStructure*>(g_value_dup_boxed(&value));
  g_value_unset(&value);
  return stats;
}
