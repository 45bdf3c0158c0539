/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * Reads a file of events and writes it as another; what they are, their names' endings say: .h5 is
 * written in DSEC's layout, .hdf5 in Metavision's.
 *
 *   event_convert recording.raw recording.dat
 *
 * ./pipelines/event-convert builds it and runs it.
 */
#include <errno.h>
#include <gst/gst.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct {
  const char* ending;
  const char* reader; /* with an element name=in that has a location */
  const char* writer; /* with one name=out; NULL where the format is only read */
} Format;

/* A file may have frames as well: they are left out. */
#define AEDAT_READER "filesrc name=in ! aedatdemux name=demuxer demuxer.events_0"

static const Format formats[] = {
    {".raw", "filesrc name=in ! evtdec", "evtenc ! filesink name=out"},
    {".dat", "filesrc name=in ! eventdatdec", "eventdatenc ! filesink name=out"},
    {".es", "filesrc name=in ! eventesdec", "eventesenc ! filesink name=out"},
    {".csv", "filesrc name=in ! eventcsvdec", "eventcsvenc ! filesink name=out"},
    {".txt", "filesrc name=in ! eventcsvdec", "eventcsvenc dialect=rpg ! filesink name=out"},
    {".npy", "filesrc name=in ! eventnpydec", "eventnpyenc ! filesink name=out"},
    {".aedat4", AEDAT_READER, "aedatmux ! filesink name=out"},
    {".aedat", AEDAT_READER, NULL},
    {".h5", "eventhdf5src name=in", "eventhdf5sink name=out"},
    {".hdf5", "eventhdf5src name=in", "eventhdf5sink layout=metavision name=out"},
};

/* The format that a file's name says; NULL, and the user is told, where it says none. */
static const Format* format_of(const char* path) {
  for (gsize i = 0; i < G_N_ELEMENTS(formats); ++i) {
    const gsize length = strlen(formats[i].ending);
    if (strlen(path) > length &&
        g_ascii_strcasecmp(path + strlen(path) - length, formats[i].ending) == 0)
      return &formats[i];
  }
  g_printerr("%s: not known by its ending; these are:", path);
  for (gsize i = 0; i < G_N_ELEMENTS(formats); ++i) g_printerr(" %s", formats[i].ending);
  g_printerr("\n");
  return NULL;
}

static gboolean can_write(const Format* format) {
  if (format->writer != NULL) return TRUE;
  g_printerr("files ending in %s are only read\n", format->ending);
  return FALSE;
}

/* Writing begins before reading ends. */
static gboolean same_file(const char* a, const char* b) {
  struct stat of_a, of_b;
  return stat(a, &of_a) == 0 && stat(b, &of_b) == 0 && of_a.st_dev == of_b.st_dev &&
         of_a.st_ino == of_b.st_ino;
}

/* Written beside the file, so that what stood there is lost only to what is whole. */
static gchar* unfinished(const char* path) {
  return g_strconcat(path, ".part", NULL);
}

static void set_location(GstElement* pipeline, const char* name, const char* path) {
  GstElement* element = gst_bin_get_by_name(GST_BIN(pipeline), name);
  g_object_set(element, "location", path, NULL);
  gst_object_unref(element);
}

/* The streaming thread counts while the main thread prints. */
static GstPadProbeReturn count_events(GstPad* pad, GstPadProbeInfo* info, gpointer events) {
  (void)pad;
  __atomic_add_fetch((guint64*)events, gst_buffer_get_size(GST_PAD_PROBE_INFO_BUFFER(info)) / 8,
                     __ATOMIC_RELAXED);
  return GST_PAD_PROBE_OK;
}

/* A line that is written over, on a terminal; in a log, one now and then. */
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

static void print_message(GstMessage* message) {
  GError* error = NULL;
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR)
    gst_message_parse_error(message, &error, NULL);
  else
    gst_message_parse_warning(message, &error, NULL);
  g_printerr("%s%s: %s\n", isatty(STDERR_FILENO) ? "\n" : "",
             GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR ? "error" : "warning", error->message);
  g_clear_error(&error);
}

static volatile sig_atomic_t interrupted;

/* Ctrl-C ends the file, so that what is written by then can be read; again, it ends the process. */
static void interrupt(int number) {
  interrupted = 1;
  signal(number, SIG_DFL);
}

/* Until the file is written, or cannot be: then FALSE. */
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
  GstElement* pipeline;
  GstElement* queue;
  GstPad* pad;
  GError* error = NULL;
  gchar* line;
  gchar* part;
  guint64 events = 0;
  gboolean ok;

  gst_init(&argc, &argv);
  if (argc != 3) {
    g_printerr("usage: %s IN OUT\n", argv[0]);
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
  line = g_strdup_printf("%s ! queue name=events ! %s", from->reader, to->writer);
  pipeline = gst_parse_launch_full(line, NULL, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  g_free(line);
  if (pipeline == NULL) {
    g_printerr("%s\n", error->message);
    g_clear_error(&error);
    return 1;
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
