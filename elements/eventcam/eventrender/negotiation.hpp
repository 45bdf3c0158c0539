// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "elements/eventcam/eventrender/state.hpp"

namespace eventrender {

GstFlowReturn update_src_caps(GstAggregator* aggregator, GstCaps* downstream, GstCaps** result);
GstCaps* fixate_src_caps(GstAggregator* aggregator, GstCaps* caps);
gboolean negotiated_src_caps(GstAggregator* aggregator, GstCaps* caps);
gboolean decide_allocation(GstAggregator* aggregator, GstQuery* query);

/// Makes ready for the events of a CAPS event; false where they cannot be drawn.
bool take_caps(GstEventRender* self, GstEvent* event);

}  // namespace eventrender
