// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "elements/eventcam/aedatdemux/state.hpp"

namespace aedatdemux {

/// A source pad's event function.
gboolean src_event(GstPad* pad, GstObject* parent, GstEvent* event);

}  // namespace aedatdemux
