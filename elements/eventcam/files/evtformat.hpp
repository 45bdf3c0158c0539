// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <optional>

#include "src/formats/evt/raw.hpp"

/// Caps of words without a header.
#define EVT_WORDS_CAPS                                                          \
  "application/x-event-camera, format = (string) { EVT2, EVT21, EVT3, EVT4 }, " \
  "width = (int) [ 1, 2048 ], height = (int) [ 1, 2048 ]"

/// Name of a format in caps, which have one byte order only.
inline const char* evt_format_name(eventcamera::EvtFormat format) {
  switch (format) {
    case eventcamera::EvtFormat::evt2:
      return "EVT2";
    case eventcamera::EvtFormat::evt21:
    case eventcamera::EvtFormat::evt21_legacy:
      return "EVT21";
    case eventcamera::EvtFormat::evt3:
      return "EVT3";
    case eventcamera::EvtFormat::evt4:
      return "EVT4";
  }
  return nullptr;
}

/// Format with this name in caps, if any.
inline std::optional<eventcamera::EvtFormat> evt_format_named(const char* name) {
  if (g_strcmp0(name, "EVT2") == 0) return eventcamera::EvtFormat::evt2;
  if (g_strcmp0(name, "EVT21") == 0) return eventcamera::EvtFormat::evt21;
  if (g_strcmp0(name, "EVT3") == 0) return eventcamera::EvtFormat::evt3;
  if (g_strcmp0(name, "EVT4") == 0) return eventcamera::EvtFormat::evt4;
  return std::nullopt;
}
