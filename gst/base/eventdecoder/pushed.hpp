// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/eventdecoder.hpp"

/// Reading of what is pushed.
namespace eventdecoder {

/// The sink pad's chain function.
GstFlowReturn chain(GstPad*, GstObject* parent, GstBuffer* buffer);

/// The sink pad's event function.
gboolean sink_event(GstPad* pad, GstObject* parent, GstEvent* event);

}  // namespace eventdecoder
