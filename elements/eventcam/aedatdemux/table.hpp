// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "elements/eventcam/aedatdemux/state.hpp"

namespace aedatdemux {

/// Reads the table at the file's end once the header has told where it is.
void seek_table(GstAedatDemux* self);

/// At the file's end, warns of a table that could not be read, where no other corruption tells why.
void warn_of_missing_table(GstAedatDemux* self);

}  // namespace aedatdemux
