// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <functional>
#include <initializer_list>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

/// Flags of properties that may change in the states NULL and READY.
inline constexpr auto mutable_ready_flags =
    static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);
/// Flags of properties that may change at any time.
inline constexpr auto mutable_playing_flags = static_cast<GParamFlags>(
    G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);
/// Flags of properties that a GstController may change over time.
inline constexpr auto controllable_flags =
    static_cast<GParamFlags>(mutable_playing_flags | GST_PARAM_CONTROLLABLE);

// Types of properties besides strings: numbers, enums and booleans.
#define FOR_EACH_PROPERTY_TYPE(X) \
  X(BOOLEAN, boolean)             \
  X(ENUM, enum) X(UINT, uint) X(INT64, int64) X(UINT64, uint64) X(DOUBLE, double)

template <class Field>
void read_value(const GValue* value, Field& field) {
#define READ(TYPE, type)                                   \
  case G_TYPE_##TYPE:                                      \
    field = static_cast<Field>(g_value_get_##type(value)); \
    break;
  if constexpr (std::is_same_v<Field, std::string>) {
    const gchar* text = g_value_get_string(value);
    field = text != nullptr ? text : "";
  } else {
    switch (G_TYPE_FUNDAMENTAL(G_VALUE_TYPE(value))) {
      FOR_EACH_PROPERTY_TYPE(READ)
      default:
        g_assert_not_reached();
    }
  }
#undef READ
}

template <class Field>
void write_value(const Field& field, GValue* value) {
#define WRITE(TYPE, type)                                                               \
  case G_TYPE_##TYPE:                                                                   \
    g_value_set_##type(value, static_cast<decltype(g_value_get_##type(value))>(field)); \
    break;
  if constexpr (std::is_same_v<Field, std::string>) {
    g_value_set_string(value, field.c_str());
  } else {
    switch (G_TYPE_FUNDAMENTAL(G_VALUE_TYPE(value))) {
      FOR_EACH_PROPERTY_TYPE(WRITE)
      default:
        g_assert_not_reached();
    }
  }
#undef WRITE
}

/// Setter and getter of a property, stored in its GParamSpec.
struct PropertyAccess {
  std::function<void(GObject*, const GValue*)> set;
  std::function<void(GObject*, GValue*)> get;

  static GQuark quark() {
    static const GQuark quark = g_quark_from_static_string("event-property-access");
    return quark;
  }
  static const PropertyAccess& of(GParamSpec* spec) {
    return *static_cast<PropertyAccess*>(g_param_spec_get_qdata(spec, quark()));
  }
};

/// For class_init: installs a property. `functions.set` is null if it is read-only.
inline void install_property(GObjectClass* klass, PropertyAccess functions, GParamSpec* spec) {
  klass->set_property = [](GObject* object, guint, const GValue* value, GParamSpec* of) {
    PropertyAccess::of(of).set(object, value);
  };
  klass->get_property = [](GObject* object, guint, GValue* value, GParamSpec* of) {
    PropertyAccess::of(of).get(object, value);
  };
  auto access = std::make_unique<PropertyAccess>(std::move(functions));
  g_param_spec_set_qdata_full(spec, PropertyAccess::quark(), access.release(), [](gpointer last) {
    const std::unique_ptr<PropertyAccess> owned(static_cast<PropertyAccess*>(last));
  });
  constexpr guint number = 1;  // properties are distinguished by their GParamSpec
  g_object_class_install_property(klass, number, spec);
}

/// Returns a structure of unsigned numbers, for the property "stats".
inline GstStructure* new_counters(const char* name,
                                  std::initializer_list<std::pair<const char*, guint64>> counters) {
  GstStructure* const structure = gst_structure_new_empty(name);
  for (const auto& [field, count] : counters)
    gst_structure_set(structure, field, G_TYPE_UINT64, count, nullptr);
  return structure;
}

/// For class_init: installs the read-only property "stats". `make` returns a new structure.
inline void install_stats(GObjectClass* klass, const std::function<GstStructure*(GObject*)>& make,
                          const char* blurb) {
  const auto get = [make](GObject* object, GValue* value) {
    g_value_take_boxed(value, make(object));
  };
  install_property(
      klass, {nullptr, get},
      g_param_spec_boxed("stats", "Statistics", blurb, GST_TYPE_STRUCTURE,
                         static_cast<GParamFlags>(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));
}

/// Nick of a property: "Maximum rate" of max-rate.
inline const char* nick_of(const char* name) {
  std::string nick = name;
  for (const auto& [prefix, word] : {std::pair("min-", "minimum-"), std::pair("max-", "maximum-")})
    if (nick.starts_with(prefix)) nick.replace(0, 4, word);
  std::ranges::replace(nick, '-', ' ');
  nick.front() = g_ascii_toupper(nick.front());
  return g_intern_string(nick.c_str());
}

/// Specification of a property of the type of `value`, its default. `limits` are the minimum and
/// the maximum of a number, or the type of an enum. Integers are unsigned unless the minimum is
/// negative.
template <class Value, class... Limits>
GParamSpec* new_spec(const char* name, const char* blurb, const Value& value, GParamFlags flags,
                     Limits... limits) {
  const char* const nick = nick_of(name);
  if constexpr (std::is_same_v<Value, bool>)
    return g_param_spec_boolean(name, nick, blurb, value ? TRUE : FALSE, flags);
  else if constexpr (std::is_same_v<Value, std::string>)
    return g_param_spec_string(name, nick, blurb, value.c_str(), flags);
  else if constexpr (sizeof...(limits) == 1)
    return g_param_spec_enum(name, nick, blurb, limits..., static_cast<gint>(value), flags);
  else if constexpr (std::is_floating_point_v<Value>)
    return g_param_spec_double(name, nick, blurb, static_cast<gdouble>(limits)..., value, flags);
  else if (((static_cast<gdouble>(limits) < 0) || ...))
    return g_param_spec_int64(name, nick, blurb, static_cast<gint64>(limits)...,
                              static_cast<gint64>(value), flags);
  else if constexpr (sizeof(Value) == sizeof(guint64))
    return g_param_spec_uint64(name, nick, blurb, static_cast<guint64>(limits)...,
                               static_cast<guint64>(value), flags);
  else
    return g_param_spec_uint(name, nick, blurb, static_cast<guint>(limits)...,
                             static_cast<guint>(value), flags);
}

/// For class_init: installs properties stored in fields of the settings: numbers, enums, booleans
/// or strings. A field is a pointer to a member of Settings, or a function that returns a reference
/// into it. `settings_of` returns the Guarded settings of an object. A class may have properties in
/// several settings.
template <auto settings_of>
class Properties {
 public:
  using Settings =
      typename std::remove_reference_t<decltype(settings_of(static_cast<GObject*>(nullptr)))>::Type;

  explicit Properties(GObjectClass* klass, Settings defaults = {})
      : klass_(klass), defaults_(std::move(defaults)) {}

  /// Adds a property that may change at any time. Limits as for new_spec().
  template <class Field, class... Limits>
  void add(Field field, const char* name, const char* blurb, Limits... limits) {
    add_with_flags(mutable_playing_flags, field, name, blurb, limits...);
  }

  /// Adds a property that a GstController may change over time.
  template <class Field, class... Limits>
  void add_controllable(Field field, const char* name, const char* blurb, Limits... limits) {
    add_with_flags(controllable_flags, field, name, blurb, limits...);
  }

  /// Adds a property that may change in the states NULL and READY.
  template <class Field, class... Limits>
  void add_fixed(Field field, const char* name, const char* blurb, Limits... limits) {
    add_with_flags(mutable_ready_flags, field, name, blurb, limits...);
  }

  template <class Set, class Get>
  void add(Set set, Get get, GParamSpec* spec) {
    install_property(
        klass_,
        {[set](GObject* object, const GValue* value) { set(*settings_of(object).lock(), value); },
         [get](GObject* object, GValue* value) { get(*settings_of(object).lock(), value); }},
        spec);
  }

 private:
  template <class Field, class... Limits>
  void add_with_flags(GParamFlags flags, Field field, const char* name, const char* blurb,
                      Limits... limits) {
    add([field](Settings& settings,
                const GValue* value) { read_value(value, std::invoke(field, settings)); },
        [field](Settings& settings, GValue* value) {
          write_value(std::invoke(field, settings), value);
        },
        new_spec(name, blurb, std::invoke(field, defaults_), flags, limits...));
  }

  GObjectClass* klass_;
  Settings defaults_;
};
