// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/eventdecoder.hpp"

/// How long a file is.
namespace eventdecoder {

/// Tells how long the file is, where that is news.
void set_duration(GstEventDecoder* self, GstClockTime duration);

/// From the first event to after the latest; where there was none since a seek, what is known.
GstClockTime duration_so_far(GstEventDecoder* self);

/// The file's, as far as it is known or can be told.
GstClockTime duration_of(GstEventDecoder* self);

}  // namespace eventdecoder
