// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/eventdecoder.hpp"

namespace eventdecoder {

/// Whether upstream can go to another byte.
bool can_seek(GstEventDecoder* self);

/// The source pad's event function.
gboolean src_event(GstPad* pad, GstObject* parent, GstEvent* event);

}  // namespace eventdecoder
