// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/eventdecoder.hpp"
#include "src/formats/chunker.hpp"

/// What goes downstream.
namespace eventdecoder {

/// Sends everything that has to be sent before data.
GstFlowReturn begin_output(GstEventDecoder* self);

/// Pushes an interval's events, or tells of its silence.
GstFlowReturn push_interval(GstEventDecoder* self, const eventcamera::Chunker::Interval& interval);

}  // namespace eventdecoder
