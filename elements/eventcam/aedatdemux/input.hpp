// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "elements/eventcam/aedatdemux/state.hpp"

/// What is read comes in.
namespace aedatdemux {

/// Reads a buffer of the file's bytes.
GstFlowReturn take_bytes(GstAedatDemux* self, GstBuffer* bytes);

/// Hands out what is left where no more bytes come. May throw.
GstFlowReturn take_end(GstAedatDemux* self);

}  // namespace aedatdemux
