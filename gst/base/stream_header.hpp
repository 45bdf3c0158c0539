// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/owned.hpp"

/// Adds `header` to the caps of a stream that it begins: who joins late, as a client of
/// tcpserversink, gets it first. Flags the buffer as a header.
OwnedCaps with_stream_header(OwnedCaps caps, GstBuffer* header);
