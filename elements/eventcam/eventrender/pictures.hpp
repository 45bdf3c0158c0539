// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "elements/eventcam/eventrender/state.hpp"

namespace eventrender {

/// Draws the state at the end of an interval and sends it on. May throw.
GstFlowReturn push_picture(GstEventRender* self, const EventInterval& events,
                           const EventInterval& picture);

/// Draws the picture that is due and sends it on. May throw.
GstFlowReturn push_next_picture(GstEventRender* self);

/// Whether anything is known of the picture that is due.
bool has_begun_picture(GstEventRender* self);

/// Sends on what there is of the last picture before things change.
void drain(GstEventRender* self);

}  // namespace eventrender
