// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "src/core/event.hpp"

namespace eventcamera {

/// Converts event times to offsets from `start`, modulo 2^32. Returns false if times decrease, or
/// begin before `latest`.
bool to_interval_times(Microseconds start, Microseconds latest,
                       std::span<const AbsoluteEvent> events, Event* out);

}  // namespace eventcamera
