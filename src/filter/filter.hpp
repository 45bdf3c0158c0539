// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <concepts>

#include "src/core/label.hpp"

namespace eventcamera {

/// Filters an event stream in place: moves the kept events to the front, in order and with their
/// labels, and returns them.
///
/// Events are inside the sensor and sorted; their times are relative to `start`, and not before the
/// previous call's. The result does not depend on how a stream is cut into calls. A filter that
/// remembers times also has forget(), after which time may start over.
template <class Type>
concept Filter = requires(Type filter, LabelledEvents events, Microseconds start,
                          const typename Type::Settings& settings) {
  { filter.filter(events, start, settings) } -> std::same_as<LabelledEvents>;
};

}  // namespace eventcamera
