// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "elements/eventcam/eventrender/state.hpp"

namespace eventrender {

/// Takes what comes next, and sends on the picture that this completes.
GstFlowReturn aggregate(GstAggregator* aggregator, gboolean timed_out);

/// When to go on without events, from a live source.
GstClockTime get_next_time(GstAggregator* aggregator);

}  // namespace eventrender
