// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <optional>

/// An interval of time, (start, end].
struct EventInterval {
  GstClockTime start;
  GstClockTime end;
};

/// What lies less than this apart is at the same time: events know microseconds.
inline constexpr GstClockTime event_resolution = GST_USECOND;

/// The interval of a buffer of events. Where it does not say how long that is, up to its last
/// event; nothing where it has no PTS.
std::optional<EventInterval> interval_of(GstBuffer* buffer);
