// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <functional>
#include <initializer_list>
#include <memory>
#include <mutex>
#include <string>
#include <type_traits>
#include <utility>

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

/// A value that is accessible only while its lock is held:
///
///     const auto shared = shared_.lock();
///     shared->duration = duration;
///
/// Make no calls while holding the lock.
template <class Value>
class Guarded {
 public:
  using Type = Value;

  class Access {
   public:
    explicit Access(Guarded& guarded) : lock_(guarded.mutex_), value_(guarded.value_) {}
    Value* operator->() const { return &value_; }
    Value& operator*() const { return value_; }

   private:
    std::lock_guard<std::mutex> lock_;
    Value& value_;
  };

  Access lock() { return Access(*this); }

  Value copy() const {
    const std::lock_guard lock(mutex_);
    return value_;
  }

 private:
  mutable std::mutex mutex_;
  Value value_{};
};

/// A value that belongs to the streaming thread of a pad. Each access holds the pad's stream lock,
/// which is recursive: the streaming thread already holds it, and any other thread, such as one
/// that changes the state, waits until that has left the element.
template <class Value>
class StreamLocked {
 public:
  class Access {
   public:
    explicit Access(StreamLocked& locked) : locked_(locked) { GST_PAD_STREAM_LOCK(locked_.pad_); }
    ~Access() { GST_PAD_STREAM_UNLOCK(locked_.pad_); }
    Access(const Access&) = delete;
    Access& operator=(const Access&) = delete;
    Value* operator->() const { return &locked_.value_; }

   private:
    StreamLocked& locked_;
  };

  explicit StreamLocked(GstPad* pad) : pad_(pad) {}

  Access lock() { return Access(*this); }
  Access operator->() { return lock(); }
  void reset() {
    const Access access(*this);
    std::destroy_at(&value_);
    std::construct_at(&value_);
  }

 private:
  GstPad* pad_;
  Value value_{};
};

/// GObject types made from tables, which must have static storage duration.

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

/// For class_init: returns an enum type with these values, terminated by one without a name.
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
