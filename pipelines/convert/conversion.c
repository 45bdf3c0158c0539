/* SPDX-License-Identifier: LGPL-2.1-or-later */
#define _POSIX_C_SOURCE 200809L /* for sigaction() */
#include "conversion.h"

#include <gst/eventcamera/eventcamera.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* A conversion that runs. */
typedef struct {
  const char* in;
  const FileElement* writer;
  const Part* part;
  GstElement* pipeline;
  guint64 events;
  gboolean labelled; /* some events have labels */
} Conversion;

/* True if only a part of the time is converted. */
static gboolean is_trimmed(const Part* part) {
  return part->from > 0 || part->to < G_MAXDOUBLE;
}

/* True if only a part of the sensor is converted. */
static gboolean is_cropped(const Part* part) {
  return part->region.width > 0;
}

/* Sets the location of the element `name`, or of the writer if it is the sink itself. */
static void set_location(GstElement* pipeline, const char* name, const char* path) {
  g_autoptr(GstElement) element = gst_bin_get_by_name(GST_BIN(pipeline), name);
  if (element == NULL) element = gst_bin_get_by_name(GST_BIN(pipeline), "writer");
  g_object_set(element, "location", path, NULL);
}

/* Limits a queue by time: events and frames may be apart by half a second, and the muxer waits for
 * the later of both, for a silent stream until it lags by half a second or more. The limit of
 * bytes is only reached by files whose times do not go on. */
static void limit_by_time(GstElement* queue) {
  g_object_set(queue, "max-size-buffers", 0, "max-size-bytes", 1U << 30, "max-size-time",
               2 * GST_SECOND, NULL);
}

/* Links the first video stream to the muxer. */
static void link_frames(GstElement* reader, GstElement* muxer, GstElement* events) {
  g_autoptr(GstPad) pad = gst_element_get_static_pad(reader, "video_0");
  if (pad == NULL) return;
  g_autoptr(GstObject) pipeline = gst_element_get_parent(reader);
  GstElement* queue = gst_element_factory_make("queue", NULL);
  limit_by_time(events);
  limit_by_time(queue);
  gst_bin_add(GST_BIN(pipeline), queue);
  gst_element_link_pads(queue, "src", muxer, "video_0");
  gst_element_link_pads(reader, "video_0", queue, "sink");
  gst_element_sync_state_with_parent(queue);
}

/* Counts the pads of events. */
static gboolean count_streams(GstElement* reader, GstPad* pad, gpointer count) {
  (void)reader;
  *(guint*)count += g_str_has_prefix(GST_PAD_NAME(pad), "events_");
  return TRUE;
}

/* True if an element has pads of this template. */
static gboolean has_pads(const FileElement* element, const char* template_name) {
  const GList* item = gst_element_factory_get_static_pad_templates(element->factory);
  for (; item != NULL; item = item->next)
    if (strcmp(((GstStaticPadTemplate*)item->data)->name_template, template_name) == 0) return TRUE;
  return FALSE;
}

/* Links the streams of a file once they are known. Runs in the streaming thread, before data
 * flows. `muxer` takes frames, too, unless it is NULL. */
static void link_streams(GstElement* reader, gpointer muxer) {
  g_autoptr(GstPad) pad = gst_element_get_static_pad(reader, "events_0");
  guint streams = 0;
  if (pad == NULL) {
    GST_ELEMENT_ERROR(reader, STREAM, WRONG_TYPE, ("The file has no events to convert."),
                      ("no stream of events among %u streams", reader->numsrcpads));
    return;
  }
  gst_element_foreach_src_pad(reader, count_streams, &streams);
  if (streams > 1)
    GST_ELEMENT_WARNING(reader, STREAM, DEMUX,
                        ("Only the first of %u streams of events is converted.", streams),
                        ("the others are those of the pads events_1 and on"));
  g_autoptr(GstObject) pipeline = gst_element_get_parent(reader);
  g_autoptr(GstElement) queue = gst_bin_get_by_name(GST_BIN(pipeline), "events");
  if (muxer != NULL) link_frames(reader, GST_ELEMENT(muxer), queue);
  gst_element_link_pads(reader, "events_0", queue, "sink");
}

static void link_when_known(const Conversion* self) {
  g_autoptr(GstElement) reader = gst_bin_get_by_name(GST_BIN(self->pipeline), "reader");
  g_autoptr(GstElement) writer = gst_bin_get_by_name(GST_BIN(self->pipeline), "writer");
  /* Frames are not cropped, so they would not match the events. */
  const gboolean takes_frames = !is_cropped(self->part) && has_pads(self->writer, "video_%u");
  g_signal_connect(reader, "no-more-pads", G_CALLBACK(link_streams), takes_frames ? writer : NULL);
}

static GstStructure* stats_of(GstElement* pipeline, const char* name) {
  g_autoptr(GstElement) element = gst_bin_get_by_name(GST_BIN(pipeline), name);
  GstStructure* stats = NULL;
  g_object_get(element, "stats", &stats, NULL);
  return stats;
}

/* Prints the content that the output format cannot store. */
static void print_left_out(const Conversion* self) {
  static const struct {
    const char* field;
    const char* name;
  } kinds[] = {{"frames", "frames"}, {"triggers", "triggers"}, {"imu-samples", "IMU samples"}};
  g_autoptr(GstStructure) read = stats_of(self->pipeline, "reader");
  g_autoptr(GstStructure) written = stats_of(self->pipeline, "writer");
  g_autoptr(GString) text = g_string_new(NULL);
  for (gsize i = 0; i < G_N_ELEMENTS(kinds); ++i) {
    guint64 of_in = 0;
    guint64 of_out = 0;
    gst_structure_get_uint64(read, kinds[i].field, &of_in);
    gst_structure_get_uint64(written, kinds[i].field, &of_out);
    if (of_in > of_out)
      g_string_append_printf(text, "%s%" G_GUINT64_FORMAT " %s", text->len > 0 ? ", " : "",
                             of_in - of_out, kinds[i].name);
  }
  guint64 labels = 0;
  gst_structure_get_uint64(written, "labels", &labels);
  if (self->labelled && labels == 0) g_string_append(text, text->len > 0 ? ", labels" : "labels");
  if (text->len > 0) fprintf(stderr, "%s: left out: %s\n", self->in, text->str);
}

/* Warns that the part had no events. */
static void print_empty(const Conversion* self) {
  gint64 duration = 0;
  fprintf(stderr, "%s: warning: no events in this part", self->in);
  if (gst_element_query_duration(self->pipeline, GST_FORMAT_TIME, &duration))
    fprintf(stderr, "; the recording lasts %.6g s", (gdouble)duration / GST_SECOND);
  fprintf(stderr, "\n");
}

/* Runs in the streaming thread, while the main thread prints. */
static GstPadProbeReturn count_events(GstPad* pad, GstPadProbeInfo* info, gpointer data) {
  Conversion* self = data;
  (void)pad;
  if ((info->type & GST_PAD_PROBE_TYPE_BUFFER) != 0) {
    GstBuffer* buffer = GST_PAD_PROBE_INFO_BUFFER(info);
    __atomic_add_fetch(&self->events, gst_buffer_get_size(buffer) / 8, __ATOMIC_RELAXED);
    if (gst_buffer_get_event_camera_label_meta(buffer) != NULL)
      __atomic_store_n(&self->labelled, TRUE, __ATOMIC_RELAXED);
  } else if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_FLUSH_STOP) {
    __atomic_store_n(&self->events, 0, __ATOMIC_RELAXED); /* the file starts over */
    __atomic_store_n(&self->labelled, FALSE, __ATOMIC_RELAXED);
  }
  return GST_PAD_PROBE_OK;
}

/* Time of a pipeline at an option's seconds. */
static gint64 nanoseconds(gdouble seconds) {
  return (gint64)(seconds * GST_SECOND + 0.5);
}

/* Makes the eventcrop of a pad keep the region, once the size of the sensor is known. Runs in the
 * streaming thread. */
static GstPadProbeReturn set_crop(GstPad* pad, GstPadProbeInfo* info, gpointer kept) {
  const Region* region = kept;
  GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
  GstCaps* caps;
  GstEventCameraInfo sensor;
  if (GST_EVENT_TYPE(event) != GST_EVENT_CAPS) return GST_PAD_PROBE_OK;
  gst_event_parse_caps(event, &caps);
  g_autoptr(GstElement) crop = gst_pad_get_parent_element(pad);
  if (!gst_event_camera_info_from_caps(&sensor, caps) ||
      region->x + region->width > (guint)sensor.width ||
      region->y + region->height > (guint)sensor.height) {
    GST_ELEMENT_ERROR(crop, STREAM, FORMAT,
                      ("The region %ux%u+%u+%u is not within the sensor.", region->width,
                       region->height, region->x, region->y),
                      ("%" GST_PTR_FORMAT, (void*)caps));
    return GST_PAD_PROBE_DROP;
  }
  g_object_set(crop, "left", region->x, "right", (guint)sensor.width - region->x - region->width,
               "top", region->y, "bottom", (guint)sensor.height - region->y - region->height, NULL);
  return GST_PAD_PROBE_OK;
}

/* Makes a reader that knows its file start over at the first time and end at the last, and plays.
 * FALSE on failure. */
static gboolean trim(const Conversion* self) {
  const Part* part = self->part;
  const gboolean ends = part->to < G_MAXDOUBLE;
  g_autoptr(GstElement) reader = gst_bin_get_by_name(GST_BIN(self->pipeline), "reader");
  const gboolean ok = gst_element_seek(
      reader, 1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE, GST_SEEK_TYPE_SET,
      nanoseconds(part->from), ends ? GST_SEEK_TYPE_SET : GST_SEEK_TYPE_NONE,
      ends ? nanoseconds(part->to) : -1);
  if (ok)
    gst_element_set_state(self->pipeline, GST_STATE_PLAYING);
  else
    fprintf(stderr, "%s cannot be sought, so --from and --to do not apply\n", self->in);
  return ok;
}

/* Prints a bar that is overwritten on a terminal, or one line per second elsewhere. */
static void print_progress(Conversion* self) {
  static const char full[] = "########################################";
  gint64 position = 0;
  gint64 duration = 0;
  const guint64 events = __atomic_load_n(&self->events, __ATOMIC_RELAXED);
  if (!gst_element_query_position(self->pipeline, GST_FORMAT_TIME, &position) ||
      !gst_element_query_duration(self->pipeline, GST_FORMAT_TIME, &duration) || duration <= 0)
    return;
  const gdouble start = self->part->from * GST_SECOND;
  const gdouble end = MIN((gdouble)duration, self->part->to * GST_SECOND);
  const gdouble share = CLAMP(((gdouble)position - start) / (end - start), 0.0, 1.0);
  if (isatty(STDERR_FILENO))
    fprintf(stderr, "\r[%-40.*s] %3.0f %%, %" G_GUINT64_FORMAT " events", (int)(40 * share), full,
            100 * share, events);
  else
    fprintf(stderr, "%3.0f %%, %" G_GUINT64_FORMAT " events\n", 100 * share, events);
}

static void clear_progress(void) {
  if (isatty(STDERR_FILENO)) fprintf(stderr, "\r\033[K");
}

/* Prints an error, a warning or a note with its cause: the debug text, after the code location. */
static void print_message(const char* in, GstMessage* message) {
  const char* kind;
  g_autoptr(GError) error = NULL;
  g_autofree gchar* debug = NULL;
  switch (GST_MESSAGE_TYPE(message)) {
    case GST_MESSAGE_ERROR:
      kind = "error";
      gst_message_parse_error(message, &error, &debug);
      break;
    case GST_MESSAGE_WARNING:
      kind = "warning";
      gst_message_parse_warning(message, &error, &debug);
      break;
    default:
      kind = "note";
      gst_message_parse_info(message, &error, &debug);
  }
  clear_progress();
  fprintf(stderr, "%s: %s: %s\n", in, kind, error->message);
  const gchar* cause = debug != NULL ? strchr(debug, '\n') : NULL;
  if (cause != NULL && cause[1] != '\0') fprintf(stderr, "  %s\n", cause + 1);
}

static volatile sig_atomic_t interrupted;

static void interrupt(int number) {
  (void)number;
  interrupted = 1;
}

void catch_interrupt(void) {
  const struct sigaction once = {.sa_handler = interrupt, .sa_flags = SA_RESETHAND};
  /* A terminal that closes sends SIGHUP, and then its shell does. nohup ignores both. */
  const struct sigaction always = {.sa_handler = interrupt};
  struct sigaction before;
  sigaction(SIGINT, &once, NULL);
  sigaction(SIGTERM, &once, NULL);
  sigaction(SIGHUP, NULL, &before);
  if (before.sa_handler != SIG_IGN) sigaction(SIGHUP, &always, NULL);
}

gboolean was_interrupted(void) {
  return interrupted != 0;
}

/* Runs until the file is written. FALSE on failure. */
static gboolean run(Conversion* self) {
  g_autoptr(GstBus) bus = gst_element_get_bus(self->pipeline);
  gboolean trimming = is_trimmed(self->part);
  gboolean ended = FALSE;
  gboolean ending = FALSE;
  gboolean ok = TRUE;
  gst_element_set_state(self->pipeline, trimming ? GST_STATE_PAUSED : GST_STATE_PLAYING);
  while (!ended) {
    if (interrupted && !ending && !trimming) {
      ending = TRUE;
      gst_element_send_event(self->pipeline, gst_event_new_eos());
    }
    g_autoptr(GstMessage) message =
        gst_bus_timed_pop_filtered(bus, GST_SECOND,
                                   GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING |
                                       GST_MESSAGE_INFO | GST_MESSAGE_ASYNC_DONE);
    if (message == NULL) {
      print_progress(self);
      continue;
    }
    if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ASYNC_DONE) {
      if (trimming) ok = trim(self);
      trimming = FALSE;
      ended = !ok;
    } else {
      ended = (GST_MESSAGE_TYPE(message) & (GST_MESSAGE_EOS | GST_MESSAGE_ERROR)) != 0;
      ok = GST_MESSAGE_TYPE(message) != GST_MESSAGE_ERROR;
      if (GST_MESSAGE_TYPE(message) != GST_MESSAGE_EOS) print_message(self->in, message);
    }
  }
  clear_progress();
  return ok;
}

/* Adds the counter of events, and the crop filter. */
static void probe(Conversion* self) {
  const gboolean crops = is_cropped(self->part);
  g_autoptr(GstElement) last =
      gst_bin_get_by_name(GST_BIN(self->pipeline), crops ? "crop" : "events");
  if (crops) {
    g_autoptr(GstPad) sink = gst_element_get_static_pad(last, "sink");
    gst_pad_add_probe(sink, GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, set_crop,
                      (gpointer)&self->part->region, NULL);
  }
  g_autoptr(GstPad) pad = gst_element_get_static_pad(last, "src");
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_FLUSH, count_events,
                    self, NULL);
}

int convert_events(const char* in, const FileElement* reader, const char* out,
                   const FileElement* writer, const ElementOptions* options, const Part* part,
                   guint64* events) {
  g_autoptr(GError) error = NULL;
  const gboolean has_streams = has_pads(reader, "events_%u");
  const gboolean is_sink =
      gst_element_factory_list_is_type(writer->factory, GST_ELEMENT_FACTORY_TYPE_SINK);
  g_autofree gchar* line = g_strdup_printf(
      "filesrc name=in ! %s name=reader %s queue name=events ! %s %s name=writer %s %s",
      GST_OBJECT_NAME(reader->factory), has_streams ? "" : "!",
      is_cropped(part) ? "eventcrop name=crop !" : "", GST_OBJECT_NAME(writer->factory),
      writer->settings, is_sink ? "" : "! filesink name=out");
  g_autoptr(GstElement) pipeline =
      gst_parse_launch_full(line, NULL, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (pipeline == NULL) {
    fprintf(stderr, "%s\n", error->message);
    return 1;
  }
  if (!set_options(options, pipeline)) return 2;
  set_location(pipeline, "in", in);
  set_location(pipeline, "out", out);
  Conversion self = {in, writer, part, pipeline, 0, FALSE};
  probe(&self);
  if (has_streams) link_when_known(&self);
  const gboolean ok = run(&self);
  if (ok) print_left_out(&self);
  if (ok && !interrupted && self.events == 0 && (is_trimmed(part) || is_cropped(part)))
    print_empty(&self);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  *events = self.events;
  return ok ? 0 : 1;
}
