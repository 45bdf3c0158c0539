// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/eventdecoder.hpp"

/// Reading of what is pulled.
namespace eventdecoder {

/// The task of a sink pad that pulls.
void loop(gpointer element);

/// The sink pad's activatemode function.
gboolean activate_mode(GstPad* pad, GstObject* parent, GstPadMode mode, gboolean active);

}  // namespace eventdecoder
