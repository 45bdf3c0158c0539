// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/reading_properties.hpp"

GParamSpec* buffer_time_spec() {
  return g_param_spec_uint64("buffer-time", "Buffer time",
                             "How much time a buffer covers (nanoseconds, in whole microseconds)",
                             GST_USECOND, 10 * GST_SECOND, default_buffer_time,
                             static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                                      GST_PARAM_MUTABLE_READY));
}

GParamSpec* reading_stats_spec() {
  return g_param_spec_boxed("stats", "Statistics",
                            "What was read since the start or the last seek, and what was left out",
                            GST_TYPE_STRUCTURE,
                            static_cast<GParamFlags>(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS));
}
