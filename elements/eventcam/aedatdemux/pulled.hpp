// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "elements/eventcam/aedatdemux/state.hpp"

/// Reading of what is pulled.
namespace aedatdemux {

/// The task of the sink pad where it pulls.
void loop(gpointer element);

/// The sink pad's activatemode function.
gboolean activate_mode(GstPad* pad, GstObject* parent, GstPadMode mode, gboolean active);

}  // namespace aedatdemux
