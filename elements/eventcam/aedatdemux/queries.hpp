// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "elements/eventcam/aedatdemux/state.hpp"

namespace aedatdemux {

/// A source pad's query function.
gboolean src_query(GstPad* pad, GstObject* parent, GstQuery* query);

}  // namespace aedatdemux
