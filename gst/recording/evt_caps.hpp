// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <optional>
#include <string_view>

#include "src/formats/evt/raw.hpp"

/// Caps of words without a header.
#define EVT_WORDS_CAPS                                                          \
  "application/x-event-camera, format = (string) { EVT2, EVT21, EVT3, EVT4 }, " \
  "width = (int) [ 1, 2048 ], height = (int) [ 1, 2048 ]"

/// Format with this name in caps, if any.
inline std::optional<eventcamera::EvtFormat> evt_format_named(const char* name) {
  return name != nullptr ? eventcamera::evt_format_named(std::string_view(name)) : std::nullopt;
}
