// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "src/core/event.hpp"

namespace eventcamera {

/// Converts events to times after `start`, the start of their interval, modulo 2^32. Returns false
/// if an event is earlier than the one before it, or the first one earlier than `latest`.
bool to_interval_times(Microseconds start, Microseconds latest,
                       std::span<const AbsoluteEvent> events, Event* out);

}  // namespace eventcamera
