// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "elements/eventcam/aedatdemux/state.hpp"

/// How long the file is.
namespace aedatdemux {

/// GST_CLOCK_TIME_NONE where nothing tells it. May throw.
GstClockTime duration_of_file(GstAedatDemux* self);

/// After the whole file was read it is known how long it is.
void learn_duration(GstAedatDemux* self);

}  // namespace aedatdemux
