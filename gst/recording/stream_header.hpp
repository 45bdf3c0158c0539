// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/owned.hpp"

/// Adds `header` to caps as streamheader, which late joiners, such as clients of tcpserversink,
/// receive first. Flags the buffer as a header.
OwnedCaps with_stream_header(OwnedCaps caps, GstBuffer* header);
