// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// How much time a buffer of events from a file covers, where the application does not say.
inline constexpr GstClockTime default_buffer_time = 10 * GST_MSECOND;

/// The property "buffer-time" of what reads a file.
GParamSpec* buffer_time_spec();

/// The property "stats" of what reads a file of events and nothing else.
GParamSpec* reading_stats_spec();
