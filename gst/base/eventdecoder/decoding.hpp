// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "gst/base/eventdecoder.hpp"

/// Reading by a Decoder.
namespace eventdecoder {

/// Decodes bytes, and hands out what is whole by then. May throw.
GstFlowReturn take_bytes(GstEventDecoder* self, std::span<const guint8> bytes, GstBuffer* buffer);

/// Decodes what is left where no more bytes come.
void finish_decoder(GstEventDecoder* self);

/// Reads the beginning of the file, all of most, for the time of the first event, the duration and
/// the size of the sensor, and goes back.
GstFlowReturn scan(GstEventDecoder* self);

/// Hands out what some more bytes make whole. GST_FLOW_EOS at the end of the file.
GstFlowReturn pull_bytes(GstEventDecoder* self);

}  // namespace eventdecoder
