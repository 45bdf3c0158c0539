/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "file_elements.h"

#include <errno.h>
#include <gst/base/gsttypefindhelper.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static gint compare(gconstpointer a, gconstpointer b) {
  return strcmp(((const FileElement*)a)->extension, ((const FileElement*)b)->extension);
}

/* Elements whose metadata have extensions: separated by commas, or by semicolons if settings follow
 * them. */
static const FileElement* elements_with(const char* key) {
  GArray* found = g_array_new(TRUE, FALSE, sizeof(FileElement));
  GList* factories = gst_registry_get_feature_list(gst_registry_get(), GST_TYPE_ELEMENT_FACTORY);
  for (GList* item = factories; item != NULL; item = item->next) {
    const gchar* text = gst_element_factory_get_metadata(item->data, key);
    g_auto(GStrv) entries = g_strsplit_set(text != NULL ? text : "", ",;", -1);
    for (gchar** entry = entries; *entry != NULL; ++entry) {
      g_auto(GStrv) words = g_strsplit(g_strstrip(*entry), " ", 2);
      const FileElement element = {gst_object_ref(item->data), g_strconcat(".", words[0], NULL),
                                   g_strdup(words[1] != NULL ? words[1] : "")};
      g_array_append_val(found, element);
    }
  }
  gst_plugin_feature_list_free(factories);
  g_array_sort(found, compare);
  return (const FileElement*)g_array_free(found, FALSE);
}

const FileElement* file_readers(void) {
  static const FileElement* readers;
  if (readers == NULL) readers = elements_with("input-extensions");
  return readers;
}

const FileElement* file_writers(void) {
  static const FileElement* writers;
  if (writers == NULL) writers = elements_with("output-extensions");
  return writers;
}

const FileElement* with_extension_of(const FileElement* elements, const char* path) {
  g_autofree gchar* lower = g_ascii_strdown(path, -1);
  for (; elements->factory != NULL; ++elements)
    if (g_str_has_suffix(lower, elements->extension)) return elements;
  return NULL;
}

static const FileElement* reader_of(const GstCaps* caps) {
  for (const FileElement* reader = file_readers(); reader->factory != NULL; ++reader)
    if (gst_element_factory_can_sink_any_caps(reader->factory, caps)) return reader;
  return NULL;
}

/* False, with an error printed, for a pipe or device: the bytes read to recognise it would be lost.
 * Called before opening, which might block on a pipe. Missing files and directories have errors of
 * their own. */
static gboolean can_read_twice(const char* path) {
  struct stat in;
  if (stat(path, &in) != 0 || S_ISREG(in.st_mode) || S_ISDIR(in.st_mode)) return TRUE;
  fprintf(stderr, "%s is not a regular file; save it to a file first\n", path);
  return FALSE;
}

const FileElement* find_reader(const char* path) {
  static const char matlab[] = "MATLAB 5.0 MAT-file";
  static guint8 start[1 << 17];  // typefinders see into compressed files, too
  const FileElement* reader = NULL;
  if (!can_read_twice(path)) return NULL;
  FILE* file = fopen(path, "rb");
  const gsize size = file != NULL ? fread(start, 1, sizeof start, file) : 0;
  if (file == NULL || ferror(file)) {
    fprintf(stderr, "%s: %s\n", path, g_strerror(errno));
    if (file != NULL) fclose(file);
    return NULL;
  }
  fclose(file);
  g_autoptr(GstCaps) caps =
      size > 0 ? gst_type_find_helper_for_data(NULL, start, size, NULL) : NULL;
  if (caps != NULL) reader = reader_of(caps);
  if (reader == NULL) reader = with_extension_of(file_readers(), path);
  if (reader == NULL && size > strlen(matlab) && memcmp(start, matlab, strlen(matlab)) == 0)
    fprintf(stderr,
            "%s: files of MATLAB are not read; docs/formats.md has a line that exports them\n",
            path);
  else if (reader == NULL)
    fprintf(stderr,
            "%s: neither its content nor its extension matches a known format; see --help\n", path);
  return reader;
}

const FileElement* find_writer(const char* path) {
  struct stat out;
  const gboolean exists = stat(path, &out) == 0;
  if (exists && S_ISDIR(out.st_mode)) {
    fprintf(stderr, "%s is a directory; name a file in it\n", path);
    return NULL;
  }
  if (exists && !S_ISREG(out.st_mode)) {
    fprintf(stderr, "%s is not a regular file, and would be replaced; name a file\n", path);
    return NULL;
  }
  const FileElement* writer = with_extension_of(file_writers(), path);
  const FileElement* reader = with_extension_of(file_readers(), path);
  if (writer == NULL && reader != NULL) {
    fprintf(stderr, "%s files can only be read\n", reader->extension);
  } else if (writer == NULL) {
    fprintf(stderr, "%s: unknown extension; known are", path);
    for (const FileElement* known = file_writers(); known->factory != NULL; ++known)
      fprintf(stderr, " %s", known->extension);
    fprintf(stderr, "\n");
  }
  return writer;
}

typedef struct {
  const char* property; /* and name of the option */
  const char* inputs;   /* files whose reader has the property; NULL if it is the writer's */
} Target;

static const Target targets[OPTION_COUNT] = {
    [OPTION_FORMAT] = {"format", NULL},
    [OPTION_COMPRESSION] = {"compression", NULL},
    [OPTION_TIME_UNIT] = {"time-unit", "text, NumPy or HDF5 files"},
    [OPTION_COLUMN_ORDER] = {"column-order", "text, NumPy or HDF5 files"},
    [OPTION_WIDTH] = {"width", "files that may lack a sensor size"},
    [OPTION_HEIGHT] = {"height", "files that may lack a sensor size"},
};

/* The values of an enum. */
static gchar* names_of(GParamSpec* spec) {
  GString* names = g_string_new(NULL);
  const GEnumClass* values = G_PARAM_SPEC_ENUM(spec)->enum_class;
  for (guint i = 0; i < values->n_values; ++i)
    g_string_append_printf(names, " %s", values->values[i].value_nick);
  return g_string_free(names, FALSE);
}

/* Returns NULL if the element has no such property. */
static GParamSpec* property_of(const FileElement* element, const char* name) {
  g_autoptr(GstPluginFeature) loaded =
      gst_plugin_feature_load(GST_PLUGIN_FEATURE(element->factory));
  if (loaded == NULL) return NULL;
  const GType type = gst_element_factory_get_element_type(GST_ELEMENT_FACTORY(loaded));
  return g_object_class_find_property(g_type_class_ref(type), name);
}

void append_accepted_values(GString* text) {
  for (gsize i = 0; i < OPTION_COUNT; ++i) {
    const FileElement* element = targets[i].inputs != NULL ? file_readers() : file_writers();
    for (; element->factory != NULL; ++element) {
      GParamSpec* spec = property_of(element, targets[i].property);
      if (spec == NULL || !G_IS_PARAM_SPEC_ENUM(spec)) continue;
      g_autofree gchar* names = names_of(spec);
      g_string_append_printf(text, "  --%s, %s:%s\n", targets[i].property, element->extension,
                             names);
    }
  }
}

gboolean options_apply(const ElementOptions* options, const FileElement* writer) {
  for (gsize i = 0; i < OPTION_COUNT; ++i) {
    const Target* target = &targets[i];
    if (options->values[i] == NULL || target->inputs != NULL) continue;
    if (property_of(writer, target->property) != NULL) continue;
    fprintf(stderr, "--%s does not apply to %s files\n", target->property, writer->extension);
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
      g_autofree gchar* names = names_of(spec);
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
