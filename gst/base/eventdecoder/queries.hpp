// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/eventdecoder.hpp"

namespace eventdecoder {

/// The source pad's query function.
gboolean src_query(GstPad* pad, GstObject* parent, GstQuery* query);

}  // namespace eventdecoder
