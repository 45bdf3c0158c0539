// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <span>

/// Makes a buffer of a copy of these bytes. Throws std::bad_alloc, where GStreamer's own allocation
/// would end the process.
GstBuffer* copied_buffer(std::span<const std::byte> bytes);
