// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "src/core/event.hpp"

namespace eventcamera {

/// Writes events to `out` with times counted from `start`, modulo 2^32. False if an event is
/// earlier than the one before it; before the first one, `latest` counts.
bool count_times_from(Microseconds start, Microseconds latest,
                      std::span<const AbsoluteEvent> events, Event* out);

}  // namespace eventcamera
