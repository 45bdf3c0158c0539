// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "gst/base/element_type.hpp"
#include "src/formats/es/es.hpp"

/// Property `origin` of the Event Stream reader and writer.
#define ES_ORIGIN_BLURB "Position of row 0, which the file does not contain"

inline GType es_origin_type() {
  using eventcamera::EsOrigin;
  return enum_type<EsOrigin>(
      "GstEsOrigin", {{EsOrigin::bottom_left,
                       "Row 0 at the bottom, as in sepia and command_line_tools", "bottom-left"},
                      {EsOrigin::top_left, "Row 0 at the top, as in faery", "top-left"}});
}
