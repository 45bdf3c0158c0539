// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/recording/recording_format.hpp"

/// Returns the element type that reads `format`, which must have static storage duration.
GType event_reader_type(const RecordingFormat& format);
