// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <initializer_list>
#include <string>

#define EVENTSIM_AUTHORS "The gst-eventsim authors"

/// For class_init: sets the metadata of an element's class. `kind` is, for example, "Filter".
inline void set_metadata(gpointer klass, const char* name, const char* kind,
                         const char* description) {
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), name, kind, description,
                                        EVENTSIM_AUTHORS);
}

/// For code of G_DEFINE_TYPE_WITH_CODE in a macro, where G_IMPLEMENT_INTERFACE would be expanded
/// too early.
inline void implement(GType type, GType interface, GInterfaceInitFunc init = nullptr) {
  const GInterfaceInfo info = {init, nullptr, nullptr};
  g_type_add_interface_static(type, interface, &info);
}

/// Defines and registers the type of an element whose data is a `Private`: priv_of() returns it,
/// field_of() one of its fields, for Properties. The functions type_init(), which makes it, and
/// type_class_init() must follow; `finalize` deletes it.
#define DEFINE_EVENT_ELEMENT(Type, type, OBJECT, Parent, PARENT_TYPE, element, rank, description) \
  G_DECLARE_FINAL_TYPE(Type, type, GST, OBJECT, Parent)                                           \
  struct _##Type {                                                                                \
    Parent parent;                                                                                \
    Private* priv;                                                                                \
  };                                                                                              \
  G_DEFINE_TYPE_WITH_CODE(Type, type, PARENT_TYPE,                                                \
                          GST_DEBUG_CATEGORY_INIT(GST_CAT_DEFAULT, #element, 0, description))     \
  GST_ELEMENT_REGISTER_DEFINE(element, #element, rank, type##_get_type())                         \
  static Private& priv_of(gpointer element) {                                                     \
    return *GST_##OBJECT(element)->priv;                                                          \
  }                                                                                               \
  template <auto field>                                                                           \
  static auto& field_of(GObject* object) {                                                        \
    return priv_of(object).*field;                                                                \
  }                                                                                               \
  static void finalize(GObject* object) {                                                         \
    delete &priv_of(object);                                                                      \
    G_OBJECT_CLASS(type##_parent_class)->finalize(object);                                        \
  }

/// Parses the value of an enum property as GStreamer does, but prints the choices if there is
/// none such: gst-launch-1.0 only says that it could not set the property.
inline gboolean parse_choice(GValue* value, const gchar* text, GParamSpec* property) {
  auto* const type = static_cast<GEnumClass*>(g_type_class_ref(G_VALUE_TYPE(value)));
  gchar* end = nullptr;
  const auto number = static_cast<gint>(g_ascii_strtoll(text, &end, 0));
  const GEnumValue* choice = g_enum_get_value_by_nick(type, text);
  if (choice == nullptr) choice = g_enum_get_value_by_name(type, text);
  if (choice == nullptr && end != text && *end == '\0') choice = g_enum_get_value(type, number);
  if (choice != nullptr) {
    g_value_set_enum(value, choice->value);
  } else if (property != nullptr) {
    std::string choices;
    for (guint i = 0; i < type->n_values; ++i)
      choices += std::string(i == 0 ? "" : ", ") + type->values[i].value_nick;
    g_message("%s=%s: choose one of %s", property->name, text, choices.c_str());
  }
  g_type_class_unref(type);
  return choice != nullptr;
}

/// For class_init: returns an enum type with these values, terminated by one without a name, which
/// must have static storage duration.
inline GType enum_type(const char* name, const GEnumValue* values) {
  GType type = g_type_from_name(name);
  if (type == G_TYPE_INVALID) {
    type = g_enum_register_static(name, values);
    gst_type_mark_as_plugin_api(type, static_cast<GstPluginAPIFlags>(0));
    auto* const parser = g_new0(GstValueTable, 1);  // GStreamer keeps it
    parser->type = type;
    parser->deserialize_with_pspec = parse_choice;
    gst_value_register(parser);
  }
  return type;
}

template <class Enum>
struct Choice {
  Enum value;
  const char* description;
  const char* name;
};

/// For class_init: returns an enum type with these values.
template <class Enum>
GType enum_type(const char* name, std::initializer_list<Choice<Enum>> choices) {
  const GType known = g_type_from_name(name);
  if (known != G_TYPE_INVALID) return known;
  auto* const values = g_new0(GEnumValue, choices.size() + 1);
  std::ranges::transform(choices, values, [](const Choice<Enum>& choice) {
    return GEnumValue{static_cast<gint>(choice.value), choice.description, choice.name};
  });
  return enum_type(name, values);  // NOLINT(clang-analyzer-unix.Malloc): the type keeps them
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
