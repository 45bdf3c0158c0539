// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <algorithm>

#include "src/core/sensor_size.hpp"

/// For transform_caps: copies those structures of `caps` for which change(GstStructure*) is true
/// after it has changed them, and intersects them with `filter`, unless it is null.
template <class Change>
GstCaps* changed_caps(const GstCaps* caps, GstCaps* filter, const Change& change) {
  GstCaps* changed = gst_caps_new_empty();
  for (guint i = 0; i < gst_caps_get_size(caps); ++i) {
    GstStructure* structure = gst_structure_copy(gst_caps_get_structure(caps, i));
    if (change(structure))
      changed = gst_caps_merge_structure(changed, structure);
    else
      gst_structure_free(structure);
  }
  if (filter == nullptr) return changed;
  GstCaps* limited = gst_caps_intersect_full(filter, changed, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(changed);
  return limited;
}

/// Sets `field` to any side of a sensor.
inline void set_any_side(GstStructure* structure, const char* field) {
  gst_structure_set(structure, field, GST_TYPE_INT_RANGE, 1, eventcamera::max_side, nullptr);
}

/// Adds `change` to a side of a sensor, or to the ends of a range, down to 1. Anything else becomes
/// any side. False if it is larger than any.
inline bool change_side(GstStructure* structure, const char* field, int change) {
  const GValue* const value = gst_structure_get_value(structure, field);
  if (value != nullptr && G_VALUE_HOLDS_INT(value)) {
    const int side = std::max(g_value_get_int(value) + change, 1);
    gst_structure_set(structure, field, G_TYPE_INT, side, nullptr);
    return side <= eventcamera::max_side;
  }
  if (value == nullptr || !GST_VALUE_HOLDS_INT_RANGE(value)) {
    set_any_side(structure, field);
    return true;
  }
  const int min = std::max(gst_value_get_int_range_min(value) + change, 1);
  const int max = std::max(gst_value_get_int_range_max(value) + change, 1);
  const int end = std::min(max, eventcamera::max_side);
  if (min < end)
    gst_structure_set(structure, field, GST_TYPE_INT_RANGE, min, end, nullptr);
  else
    gst_structure_set(structure, field, G_TYPE_INT, min, nullptr);
  return min <= end;
}
