// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// GObject types that are made from tables. A table lives as long as the process.

/// The type of a property with these values, the last of which has no name. For class_init.
inline GType enum_type(const char* name, const GEnumValue* values) {
  GType type = g_type_from_name(name);
  if (type == G_TYPE_INVALID) {
    type = g_enum_register_static(name, values);
    gst_type_mark_as_plugin_api(type, static_cast<GstPluginAPIFlags>(0));
  }
  return type;
}

/// The type of an element that a row of a table describes: `parent`, with a class_init that gets
/// the row.
inline GType row_type(GType parent, const char* name, GClassInitFunc class_init,
                      gconstpointer row) {
  const GType known = g_type_from_name(name);
  if (known != G_TYPE_INVALID) return known;
  GTypeQuery size;
  g_type_query(parent, &size);
  GTypeInfo info = {};
  info.class_size = static_cast<guint16>(size.class_size);
  info.class_init = class_init;
  info.class_data = row;
  info.instance_size = static_cast<guint16>(size.instance_size);
  return g_type_register_static(parent, name, &info, static_cast<GTypeFlags>(0));
}
