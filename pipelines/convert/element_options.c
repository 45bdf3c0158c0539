/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "element_options.h"

#include <stdio.h>
#include <string.h>

typedef struct {
  const char* property; /* and name of the option */
  const char* inputs;   /* files whose reader has the property; NULL if it is the writer's */
} Target;

static const Target targets[OPTION_COUNT] = {
    [OPTION_FORMAT] = {"format", NULL},
    [OPTION_COMPRESSION] = {"compression", NULL},
    [OPTION_TIME_UNIT] = {"time-unit", "text or NumPy files"},
    [OPTION_COLUMN_ORDER] = {"column-order", "text or NumPy files"},
    [OPTION_WIDTH] = {"width", "files that may lack a sensor size"},
    [OPTION_HEIGHT] = {"height", "files that may lack a sensor size"},
};

/* Values that an option accepts: those of the element's property. */
static gchar* names_of(GObject* element, const char* property) {
  GString* names = g_string_new(NULL);
  GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(element), property);
  const GEnumClass* values = G_PARAM_SPEC_ENUM(spec)->enum_class;
  for (guint i = 0; i < values->n_values; ++i)
    g_string_append_printf(names, " %s", values->values[i].value_nick);
  return g_string_free(names, FALSE);
}

void append_accepted_values(GString* text, const char* files, const char* element,
                            const char* property) {
  g_autoptr(GstElement) made = gst_element_factory_make(element, NULL);
  if (made == NULL) return; /* built without it */
  gst_object_ref_sink(made);
  g_autofree gchar* names = names_of(G_OBJECT(made), property);
  g_string_append_printf(text, "  --%s, %s:%s\n", property, files, names);
}

gboolean options_apply(const ElementOptions* options, const Format* format) {
  for (gsize i = 0; i < OPTION_COUNT; ++i) {
    const Target* target = &targets[i];
    if (options->values[i] == NULL || target->inputs != NULL) continue;
    if (format->options != NULL && strstr(format->options, target->property) != NULL) continue;
    fprintf(stderr, "--%s does not apply to %s files\n", target->property, format->extension);
    return FALSE;
  }
  return TRUE;
}

/* Sets a property to the value of an option. */
static gboolean set_option(GstElement* element, const Target* target, const gchar* text) {
  GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(element), target->property);
  if (spec == NULL) {
    fprintf(stderr, "--%s applies only to reading %s\n", target->property, target->inputs);
    return FALSE;
  }
  if (G_IS_PARAM_SPEC_ENUM(spec)) {
    const GEnumValue* value = g_enum_get_value_by_nick(G_PARAM_SPEC_ENUM(spec)->enum_class, text);
    if (value == NULL) {
      g_autofree gchar* names = names_of(G_OBJECT(element), target->property);
      fprintf(stderr, "--%s: no \"%s\"; choose one of%s\n", target->property, text, names);
      return FALSE;
    }
    g_object_set(element, target->property, value->value, NULL);
  } else if (G_IS_PARAM_SPEC_UINT(spec)) {
    const GParamSpecUInt* range = G_PARAM_SPEC_UINT(spec);
    guint64 number = 0;
    g_autoptr(GError) error = NULL;
    if (!g_ascii_string_to_unsigned(text, 10, range->minimum, range->maximum, &number, &error)) {
      fprintf(stderr, "--%s: %s\n", target->property, error->message);
      return FALSE;
    }
    g_object_set(element, target->property, (guint)number, NULL);
  } else {
    g_object_set(element, target->property, text, NULL);
  }
  return TRUE;
}

gboolean set_options(const ElementOptions* options, GstElement* pipeline) {
  for (gsize i = 0; i < OPTION_COUNT; ++i) {
    const Target* target = &targets[i];
    if (options->values[i] == NULL) continue;
    g_autoptr(GstElement) element =
        gst_bin_get_by_name(GST_BIN(pipeline), target->inputs != NULL ? "reader" : "writer");
    if (!set_option(element, target, options->values[i])) return FALSE;
  }
  return TRUE;
}
