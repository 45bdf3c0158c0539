// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// GObject types made from tables, which must have static storage duration.

/// For class_init: returns an enum type with these values, terminated by one without a name.
inline GType enum_type(const char* name, const GEnumValue* values) {
  GType type = g_type_from_name(name);
  if (type == G_TYPE_INVALID) {
    type = g_enum_register_static(name, values);
    gst_type_mark_as_plugin_api(type, static_cast<GstPluginAPIFlags>(0));
  }
  return type;
}

/// Registers a type. For classes that several plugins contain, each with its own type name: names
/// are unique in a process, and g_type_register_static() refuses a second one
/// (check_type_name_I() of gtype.c), so G_DEFINE_TYPE would fail in the second plugin. The classes
/// are not in the library gsteventcamera-1.0, because they are no public API.
template <class Instance, class Class>
GType register_type(GType parent, const char* name, void (*class_init)(Class*),
                    void (*init)(Instance*), GTypeFlags flags) {
  const auto any = [](auto function) { return reinterpret_cast<void (*)()>(function); };
  return g_type_register_static_simple(
      parent, name, sizeof(Class), reinterpret_cast<GClassInitFunc>(any(class_init)),
      sizeof(Instance), reinterpret_cast<GInstanceInitFunc>(any(init)), flags);
}

/// Returns the element type that a row of a table describes: a subclass of `parent` whose
/// class_init receives the row as class data.
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
