// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "elements/eventcam/aedatdemux/state.hpp"

/// What goes downstream.
namespace aedatdemux {

/// Hands out the intervals that are whole.
GstFlowReturn push_intervals(GstAedatDemux* self, Stream& stream);

/// Tells of silence in streams that are far behind the others. GST_FLOW_EOS where all are past the
/// segment.
GstFlowReturn catch_up(GstAedatDemux* self);

/// Hands out events, as far as their intervals are whole.
GstFlowReturn put_out(GstAedatDemux* self, std::size_t index,
                      std::span<const AbsoluteEvent> events);

/// Hands out a frame.
GstFlowReturn put_out(GstAedatDemux* self, std::size_t index, Frame frame);

/// The end of the file, or of the segment.
void end_streams(GstAedatDemux* self);

}  // namespace aedatdemux
