// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/eventdecoder.hpp"

/// What is told of a file that is read.
namespace eventdecoder {

/// What was read and left out, for an application.
GstStructure* make_stats(GstEventDecoder* self);

/// Brings the statistics up to date, and warns of corruption that is new.
void report(GstEventDecoder* self);

/// Tells, at the end, what was left out.
void warn_of_dropped(GstEventDecoder* self);

}  // namespace eventdecoder
