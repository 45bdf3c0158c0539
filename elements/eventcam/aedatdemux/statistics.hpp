// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "elements/eventcam/aedatdemux/state.hpp"

/// What is told of a file that is read.
namespace aedatdemux {

/// What was read and left out, for an application.
GstStructure* make_stats(GstAedatDemux* self);

/// Brings the statistics up to date, and warns of corruption that is new.
void report(GstAedatDemux* self);

/// Tells, at the end, what was left out.
void tell_counts(GstAedatDemux* self);

}  // namespace aedatdemux
