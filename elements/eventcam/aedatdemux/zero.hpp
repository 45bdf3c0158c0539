// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "elements/eventcam/aedatdemux/state.hpp"

/// The zero of time, and what is held back until it is known.
namespace aedatdemux {

/// Holds events back.
void hold(State& state, std::size_t index, std::span<const AbsoluteEvent> events);

/// Holds a frame back.
void hold(State& state, std::size_t index, Frame frame);

/// Whether enough is known to begin.
bool is_zero_known(const State& state);

/// Shows the streams, with the earliest time of any as their zero, and hands out what was held
/// back.
GstFlowReturn release(GstAedatDemux* self);

}  // namespace aedatdemux
