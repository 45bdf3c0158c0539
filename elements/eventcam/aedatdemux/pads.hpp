// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "elements/eventcam/aedatdemux/state.hpp"

/// The source pads, and what goes through them before data.
namespace aedatdemux {

/// For class_init.
void add_pad_templates(GstElementClass* klass);

/// From the zero of time to the PTS.
GstClockTime pts_of(const State& state, GstClockTime time);

/// Sends the caps of a stream whose size or frames are known.
bool send_caps(Stream& stream);

/// Sends the segment, where the stream has not got it.
void send_segment(GstAedatDemux* self, Stream& stream);

/// Makes the pad of a stream whose size or frames are known.
void make_pad(GstAedatDemux* self, std::size_t index);

/// Adds the pads that are made and not yet there.
void show_pads(GstAedatDemux* self);

}  // namespace aedatdemux
