// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/broken_events.hpp"

#include <utility>

void BrokenEvents::warn(gpointer element, const char* what) {
  GST_WARNING_OBJECT(element, "%s", what);
  if (std::exchange(warned_, true)) return;
  GST_ELEMENT_WARNING(element, STREAM, FORMAT,
                      ("The events are broken: %s. These are %s.", what, fate_), (nullptr));
}
