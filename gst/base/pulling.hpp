// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// Of a file that is pulled, so many bytes are pulled at once.
constexpr guint pulled_piece = 1 << 18;

/// A sink pad's activate function: bytes are pulled where upstream can be sought in, as filesrc,
/// else they are pushed.
gboolean activate_pulling(GstPad* sink, GstObject* parent);

/// How long the file is that comes from upstream; 0 where nobody knows.
guint64 upstream_bytes(GstPad* sink);
