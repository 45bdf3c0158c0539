// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/eventdecoder.hpp"

/// Events as they were read become intervals in order.
namespace eventdecoder {

/// Puts what the decoder has made of the last bytes, of this buffer if they were pushed, in order.
/// May throw.
void slice(GstEventDecoder* self, GstBuffer* buffer);

/// Pushes the intervals that are whole.
GstFlowReturn hand_out(GstEventDecoder* self);

/// What comes next does not follow on what was read.
void forget_times(GstEventDecoder* self);

}  // namespace eventdecoder
