/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * Converts event files; the extensions of the names select the formats:
 *
 *   event-convert recording.raw recording.dat
 *   event-convert --format=EVT2 recording.aedat4 recording.raw
 */
#include <errno.h>
#include <gst/gst.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct {
  const char* extension;
  const char* description;
  const char* reader;
  const char* writer; /* an element name=writer; NULL where the format is only read */
  const char* option; /* the writer's property that an option of this program sets, or NULL */
} Format;

/* Frames in the same file are left out. */
#define AEDAT_READER "aedatdemux name=demuxer demuxer.events_0"

static const Format formats[] = {
    {".raw", "Prophesee RAW", "evtdec", "evtenc name=writer ! filesink name=out", "format"},
    {".dat", "Prophesee DAT", "eventdatdec", "eventdatenc name=writer ! filesink name=out", NULL},
    {".es", "Event Stream", "eventesdec", "eventesenc name=writer ! filesink name=out", NULL},
    {".csv", "text", "eventcsvdec", "eventcsvenc name=writer ! filesink name=out", "dialect"},
    {".txt", "text, dialect rpg by default", "eventcsvdec",
     "eventcsvenc name=writer dialect=rpg ! filesink name=out", "dialect"},
    {".npy", "NumPy array", "eventnpydec", "eventnpyenc name=writer ! filesink name=out", NULL},
    {".aedat4", "AEDAT 4, without its frames", AEDAT_READER,
     "aedatmux name=writer ! filesink name=out", "compression"},
    {".aedat", "AEDAT 2.0 and 3.1, read only", AEDAT_READER, NULL, NULL},
    {".h5", "HDF5, written in the layout of DSEC", "eventhdf5dec", "eventhdf5sink name=writer",
     "compression"},
    {".hdf5", "HDF5, written in the layout of Metavision", "eventhdf5dec",
     "eventhdf5sink name=writer layout=metavision", NULL},
};

static gchar* evt_format;
static gchar* dialect;
static gchar* compression;

static const GOptionEntry options[] = {
    {"format", 'f', 0, G_OPTION_ARG_STRING, &evt_format, "Words of a .raw file", "NAME"},
    {"dialect", 'd', 0, G_OPTION_ARG_STRING, &dialect, "Dialect of a .csv or .txt file", "NAME"},
    {"compression", 'c', 0, G_OPTION_ARG_STRING, &compression,
     "Compression of an .aedat4 or .h5 file", "NAME"},
    G_OPTION_ENTRY_NULL,
};

static const gchar* option_value(const char* name) {
  if (strcmp(name, "format") == 0) return evt_format;
  return strcmp(name, "dialect") == 0 ? dialect : compression;
}

/* The names that an option accepts: the values of the element's property. */
static gchar* names_of(GObject* element, const char* property) {
  GString* names = g_string_new(NULL);
  GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(element), property);
  const GEnumClass* values = G_PARAM_SPEC_ENUM(spec)->enum_class;
  for (guint i = 0; i < values->n_values; ++i)
    g_string_append_printf(names, " %s", values->values[i].value_nick);
  return g_string_free(names, FALSE);
}

static void append_names(GString* text, const char* what, const char* factory,
                         const char* property) {
  GstElement* element = gst_element_factory_make(factory, NULL);
  if (element == NULL) return; /* built without it */
  gst_object_ref_sink(element);
  gchar* names = names_of(G_OBJECT(element), property);
  g_string_append_printf(text, "  --%s, %s:%s\n", property, what, names);
  g_free(names);
  gst_object_unref(element);
}

/* The part of --help that follows the options. */
static gchar* help(void) {
  GString* text = g_string_new("Formats, by the extension of a file's name:\n");
  for (gsize i = 0; i < G_N_ELEMENTS(formats); ++i)
    g_string_append_printf(text, "  %-8s %s\n", formats[i].extension, formats[i].description);
  g_string_append(text, "\nNames that options accept:\n");
  append_names(text, ".raw", "evtenc", "format");
  append_names(text, ".csv and .txt", "eventcsvenc", "dialect");
  append_names(text, ".aedat4", "aedatmux", "compression");
  append_names(text, ".h5", "eventhdf5sink", "compression");
  g_string_append(text, "\nExit status: 0 = converted, 1 = failed or interrupted, 2 = wrong usage");
  return g_string_free(text, FALSE);
}

/* The format that a file's extension selects; prints an error and returns NULL for others. */
static const Format* format_of(const char* path) {
  for (gsize i = 0; i < G_N_ELEMENTS(formats); ++i) {
    const gsize length = strlen(formats[i].extension);
    if (strlen(path) > length &&
        g_ascii_strcasecmp(path + strlen(path) - length, formats[i].extension) == 0)
      return &formats[i];
  }
  g_printerr("%s: unknown extension; known are", path);
  for (gsize i = 0; i < G_N_ELEMENTS(formats); ++i) g_printerr(" %s", formats[i].extension);
  g_printerr("\n");
  return NULL;
}

/* Whether a file can be written in this format, with the options that were given. */
static gboolean can_write(const Format* format) {
  if (format->writer == NULL) {
    g_printerr("%s files can only be read\n", format->extension);
    return FALSE;
  }
  for (const GOptionEntry* option = options; option->long_name != NULL; ++option) {
    if (option_value(option->long_name) != NULL &&
        g_strcmp0(format->option, option->long_name) != 0) {
      g_printerr("--%s does not apply to %s files\n", option->long_name, format->extension);
      return FALSE;
    }
  }
  return TRUE;
}

static gboolean set_option(GstElement* pipeline, const char* name) {
  GstElement* writer = gst_bin_get_by_name(GST_BIN(pipeline), "writer");
  GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(writer), name);
  GEnumClass* values = G_PARAM_SPEC_ENUM(spec)->enum_class;
  const GEnumValue* value = g_enum_get_value_by_nick(values, option_value(name));
  if (value == NULL) {
    gchar* names = names_of(G_OBJECT(writer), name);
    g_printerr("--%s: no \"%s\"; choose one of%s\n", name, option_value(name), names);
    g_free(names);
  } else {
    g_object_set(writer, name, value->value, NULL);
  }
  gst_object_unref(writer);
  return value != NULL;
}

/* Writing starts before reading ends, so it would destroy the input. */
static gboolean same_file(const char* a, const char* b) {
  struct stat of_a, of_b;
  return stat(a, &of_a) == 0 && stat(b, &of_b) == 0 && of_a.st_dev == of_b.st_dev &&
         of_a.st_ino == of_b.st_ino;
}

/* Output goes to a file beside OUT, so that only a complete file replaces an existing one. */
static gchar* unfinished(const char* path) {
  return g_strconcat(path, ".part", NULL);
}

/* Sets the location of an element; a writer that is a sink has its own. */
static void set_location(GstElement* pipeline, const char* name, const char* path) {
  GstElement* element = gst_bin_get_by_name(GST_BIN(pipeline), name);
  if (element == NULL) element = gst_bin_get_by_name(GST_BIN(pipeline), "writer");
  g_object_set(element, "location", path, NULL);
  gst_object_unref(element);
}

/* Runs in the streaming thread, while the main thread prints. */
static GstPadProbeReturn count_events(GstPad* pad, GstPadProbeInfo* info, gpointer events) {
  (void)pad;
  __atomic_add_fetch((guint64*)events, gst_buffer_get_size(GST_PAD_PROBE_INFO_BUFFER(info)) / 8,
                     __ATOMIC_RELAXED);
  return GST_PAD_PROBE_OK;
}

/* One line, overwritten, on a terminal; a line a second elsewhere. */
static void print_progress(GstElement* pipeline, guint64 events) {
  gint64 position = 0;
  gint64 duration = 0;
  if (!gst_element_query_position(pipeline, GST_FORMAT_TIME, &position) ||
      !gst_element_query_duration(pipeline, GST_FORMAT_TIME, &duration) || duration <= 0)
    return;
  g_printerr("%s%3.0f %%, %" G_GUINT64_FORMAT " events%s", isatty(STDERR_FILENO) ? "\r" : "",
             CLAMP(100.0 * (gdouble)position / (gdouble)duration, 0.0, 100.0), events,
             isatty(STDERR_FILENO) ? "" : "\n");
}

/* Prints an error or a warning, and its cause, which follows the place in the debug text. */
static void print_message(GstMessage* message) {
  const gboolean fatal = GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR;
  GError* error = NULL;
  gchar* debug = NULL;
  const gchar* cause;
  if (fatal)
    gst_message_parse_error(message, &error, &debug);
  else
    gst_message_parse_warning(message, &error, &debug);
  g_printerr("%s%s: %s\n", isatty(STDERR_FILENO) ? "\n" : "", fatal ? "error" : "warning",
             error->message);
  cause = debug != NULL ? strchr(debug, '\n') : NULL;
  if (cause != NULL && cause[1] != '\0') g_printerr("  %s\n", cause + 1);
  g_free(debug);
  g_clear_error(&error);
}

static volatile sig_atomic_t interrupted;

/* The first Ctrl-C ends the file, so that its events so far can be read; the second kills. */
static void interrupt(int number) {
  interrupted = 1;
  signal(number, SIG_DFL);
}

/* Runs until the file is written; FALSE if it cannot be. */
static gboolean run(GstElement* pipeline, const guint64* events) {
  GstBus* bus = gst_element_get_bus(pipeline);
  gboolean ended = FALSE;
  gboolean ending = FALSE;
  gboolean ok = TRUE;
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  while (!ended) {
    if (interrupted && !ending) {
      ending = TRUE;
      gst_element_send_event(pipeline, gst_event_new_eos());
    }
    GstMessage* message = gst_bus_timed_pop_filtered(
        bus, GST_SECOND, GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING);
    if (message == NULL) {
      print_progress(pipeline, __atomic_load_n(events, __ATOMIC_RELAXED));
      continue;
    }
    ended = GST_MESSAGE_TYPE(message) != GST_MESSAGE_WARNING;
    ok = GST_MESSAGE_TYPE(message) != GST_MESSAGE_ERROR;
    if (GST_MESSAGE_TYPE(message) != GST_MESSAGE_EOS) print_message(message);
    gst_message_unref(message);
  }
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(bus);
  if (interrupted) g_printerr("interrupted\n");
  return ok;
}

int main(int argc, char** argv) {
  const Format* from;
  const Format* to;
  GOptionContext* context;
  GstElement* pipeline;
  GstElement* queue;
  GstPad* pad;
  GError* error = NULL;
  gchar* text;
  gchar* line;
  gchar* part;
  guint64 events = 0;
  gboolean ok;

  gst_init(&argc, &argv);
  context = g_option_context_new("IN OUT - converts event files");
  text = help();
  g_option_context_set_description(context, text);
  g_free(text);
  g_option_context_add_main_entries(context, options, NULL);
  ok = g_option_context_parse(context, &argc, &argv, &error);
  g_option_context_free(context);
  if (!ok || argc != 3) {
    g_printerr("%s; see %s --help\n", ok ? "needs IN and OUT" : error->message, g_get_prgname());
    g_clear_error(&error);
    return 2;
  }
  from = format_of(argv[1]);
  to = format_of(argv[2]);
  if (from == NULL || to == NULL || !can_write(to)) return 2;
  if (access(argv[1], R_OK) != 0) {
    g_printerr("%s: %s\n", argv[1], g_strerror(errno));
    return 1;
  }
  if (same_file(argv[1], argv[2])) {
    g_printerr("%s and %s are the same file\n", argv[1], argv[2]);
    return 2;
  }
  line = g_strdup_printf("filesrc name=in ! %s ! queue name=events ! %s", from->reader, to->writer);
  pipeline = gst_parse_launch_full(line, NULL, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  g_free(line);
  if (pipeline == NULL) {
    g_printerr("%s\n", error->message);
    g_clear_error(&error);
    return 1;
  }
  if (to->option != NULL && option_value(to->option) != NULL && !set_option(pipeline, to->option)) {
    gst_object_unref(pipeline);
    return 2;
  }
  set_location(pipeline, "in", argv[1]);
  part = unfinished(argv[2]);
  set_location(pipeline, "out", part);
  queue = gst_bin_get_by_name(GST_BIN(pipeline), "events");
  pad = gst_element_get_static_pad(queue, "src");
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, count_events, &events, NULL);
  gst_object_unref(pad);
  gst_object_unref(queue);

  signal(SIGINT, interrupt);
  ok = run(pipeline, &events);
  gst_object_unref(pipeline);
  if (!ok) {
    remove(part);
  } else if (rename(part, argv[2]) != 0) {
    g_printerr("%s: %s\n", argv[2], g_strerror(errno));
    ok = FALSE;
  }
  g_free(part);
  if (interrupted) return 1;
  if (ok)
    g_print("%s%" G_GUINT64_FORMAT " events from %s to %s\n", isatty(STDERR_FILENO) ? "\r" : "",
            events, argv[1], argv[2]);
  return ok ? 0 : 1;
}
