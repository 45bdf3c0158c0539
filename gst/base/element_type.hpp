// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// Author of all elements.
#define EVENTSIM_AUTHORS "The gst-eventsim authors"

/// For class_init: sets the metadata of an element's class. `kind` is, for example, "Filter".
inline void set_metadata(gpointer klass, const char* name, const char* kind,
                         const char* description) {
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), name, kind, description,
                                        EVENTSIM_AUTHORS);
}

/// Defines and registers the type of an element whose data is a `Private`. The functions
/// type_init(), which makes it, and type_class_init() must follow; `finalize` deletes it.
#define DEFINE_EVENT_ELEMENT(Type, type, OBJECT, Parent, PARENT_TYPE, element, rank, description) \
  G_DECLARE_FINAL_TYPE(Type, type, GST, OBJECT, Parent)                                           \
  struct _##Type {                                                                                \
    Parent parent;                                                                                \
    Private* priv;                                                                                \
  };                                                                                              \
  G_DEFINE_TYPE_WITH_CODE(Type, type, PARENT_TYPE,                                                \
                          GST_DEBUG_CATEGORY_INIT(GST_CAT_DEFAULT, #element, 0, description))     \
  GST_ELEMENT_REGISTER_DEFINE(element, #element, rank, type##_get_type())                         \
  static void finalize(GObject* object) {                                                         \
    delete GST_##OBJECT(object)->priv;                                                            \
    G_OBJECT_CLASS(type##_parent_class)->finalize(object);                                        \
  }
