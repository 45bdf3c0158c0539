// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/eventdecoder.hpp"

namespace eventdecoder {

/// Hands out what is left where no more bytes come. May throw.
GstFlowReturn take_end(GstEventDecoder* self);

}  // namespace eventdecoder
