// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "gst/base/eventdecoder.hpp"

/// Reading of an EventFile.
namespace eventdecoder {

/// Adds to a file that is pushed. May throw.
void collect(GstEventDecoder* self, std::span<const guint8> bytes);

/// Hands out the events of a file that was collected. May throw.
GstFlowReturn read_collected(GstEventDecoder* self);

/// Opens a file that is pulled, for the time of its first event, its duration, and the size of the
/// sensor. May throw.
GstFlowReturn scan_file(GstEventDecoder* self);

/// Hands out some more events. GST_FLOW_EOS at the end of the file.
GstFlowReturn pull_events(GstEventDecoder* self);

}  // namespace eventdecoder
