// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#define PACKAGE "gst-eventsim"

// clang-format off
/// Defines a plugin. ELEMENTS, TYPE_FINDERS and PROVIDERS, of devices, are macros that apply a macro
/// to each name.
#define EVENTSIM_PLUGIN(name, description, ELEMENTS, TYPE_FINDERS, PROVIDERS)              \
  G_BEGIN_DECLS                                                                            \
  ELEMENTS(EVENTSIM_DECLARE_ELEMENT)                                                       \
  TYPE_FINDERS(EVENTSIM_DECLARE_TYPE_FINDER)                                               \
  PROVIDERS(EVENTSIM_DECLARE_PROVIDER)                                                     \
  G_END_DECLS                                                                              \
  static gboolean plugin_init(GstPlugin* plugin) {                                         \
    gboolean registered = FALSE;                                                           \
    ELEMENTS(EVENTSIM_REGISTER_ELEMENT)                                                    \
    TYPE_FINDERS(EVENTSIM_REGISTER_TYPE_FINDER)                                            \
    PROVIDERS(EVENTSIM_REGISTER_PROVIDER)                                                  \
    return registered;                                                                     \
  }                                                                                        \
  GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, name, description, plugin_init,  \
                    PACKAGE_VERSION, "LGPL", PACKAGE, "Unknown package origin")
// clang-format on

#define EVENTSIM_NONE(X)

#define EVENTSIM_DECLARE_ELEMENT(name) GST_ELEMENT_REGISTER_DECLARE(name)
#define EVENTSIM_DECLARE_TYPE_FINDER(name) GST_TYPE_FIND_REGISTER_DECLARE(name)
#define EVENTSIM_DECLARE_PROVIDER(name) GST_DEVICE_PROVIDER_REGISTER_DECLARE(name)
#define EVENTSIM_REGISTER_ELEMENT(name) registered |= GST_ELEMENT_REGISTER(name, plugin);
#define EVENTSIM_REGISTER_TYPE_FINDER(name) registered |= GST_TYPE_FIND_REGISTER(name, plugin);
#define EVENTSIM_REGISTER_PROVIDER(name) registered |= GST_DEVICE_PROVIDER_REGISTER(name, plugin);
