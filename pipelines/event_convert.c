/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * Converts event files: IN is recognised by its content, the extension of OUT selects its format.
 *
 *   event-convert recording.raw recording.dat
 *   event-convert --format=EVT2 recording.aedat4 recording.raw
 *   event-convert --output-directory=texts --extension=csv *.raw
 */
#define _XOPEN_SOURCE 700 /* for realpath() */
#include <errno.h>
#include <fcntl.h>
#include <gst/base/gsttypefindhelper.h>
#include <gst/eventcamera/eventcamera.h>
#include <gst/gst.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "plugin.h"

/* Prints text unchanged: names are bytes, messages are UTF-8. g_print() would replace characters
 * that the locale lacks. */
#define PRINT_ERROR(...) fprintf(stderr, __VA_ARGS__)

typedef struct {
  const char* media_type;
  const char* element;
  gboolean has_streams; /* a pad for each: events_0, video_0, ... */
} Reader;

static const Reader readers[] = {
    {"application/x-prophesee-raw", "evtdec", FALSE},
    {"application/x-prophesee-dat", "eventdatdec", FALSE},
    {"application/x-es", "eventesdec", FALSE},
    {"application/x-atis-bin", "eventatisdec", FALSE},
    {"application/x-event-csv", "eventcsvdec", FALSE},
    {"application/x-npy", "eventnpydec", FALSE},
    {"application/x-npz", "eventnpzdec", FALSE},
    {"application/x-aedat", "aedatdemux", TRUE},
    {"application/x-hdf5", "eventhdf5dec", FALSE},
    {"application/x-mcap", "eventmcapdec", TRUE},
    {"application/x-rosbag", "eventbagdec", TRUE},
    {"application/x-rosbag2-db3", "eventbagdec", TRUE},
};

typedef struct {
  const char* extension;
  const char* description;
  const char* media_type;
  const char* writer;  /* an element name=writer; NULL if the format is read-only */
  const char* options; /* writer properties that options can set, or NULL */
} Format;

static const Format formats[] = {
    {".raw", "Prophesee RAW", "application/x-prophesee-raw",
     "evtenc name=writer ! filesink name=out", "format"},
    {".dat", "Prophesee DAT", "application/x-prophesee-dat",
     "eventdatenc name=writer ! filesink name=out", NULL},
    {".es", "Event Stream", "application/x-es", "eventesenc name=writer ! filesink name=out", NULL},
    {".csv", "text", "application/x-event-csv", "eventcsvenc name=writer ! filesink name=out",
     "format"},
    {".txt", "text, format rpg by default", "application/x-event-csv",
     "eventcsvenc name=writer format=rpg ! filesink name=out", "format"},
    {".npy", "NumPy array", "application/x-npy", "eventnpyenc name=writer ! filesink name=out",
     NULL},
    {".npz", "NumPy archive, with the size of the sensor", "application/x-npz",
     "eventnpzenc name=writer ! filesink name=out", NULL},
    {".aedat4", "AEDAT 4; with the frames, triggers and IMU samples of other recordings",
     "application/x-aedat", "aedatmux name=writer ! filesink name=out", "compression"},
    {".aedat", "AEDAT 1.0, 2.0 and 3.1, read only", "application/x-aedat", NULL, NULL},
    {".h5", "HDF5, written in the layout of DSEC", "application/x-hdf5",
     "eventhdf5sink name=writer", "compression"},
    {".hdf5", "HDF5, written in the layout of Metavision", "application/x-hdf5",
     "eventhdf5sink name=writer format=metavision", NULL},
    {".mcap", "MCAP, a bag of ROS 2", "application/x-mcap",
     "eventmcapenc name=writer ! filesink name=out", "format compression"},
    {".bin", "N-MNIST and N-Caltech101, read only", "application/x-atis-bin", NULL, NULL},
    {".bag", "bag of ROS 1, read only", "application/x-rosbag", NULL, NULL},
    {".db3", "bag of ROS 2 with SQLite, read only", "application/x-rosbag2-db3", NULL, NULL},
};

typedef struct {
  const char* name;   /* same as that of the property */
  const char* inputs; /* files whose reader has the property; NULL if it is the writer's */
  gchar* value;       /* NULL if not given */
} Option;

static Option properties[] = {
    {"format", NULL, NULL},
    {"compression", NULL, NULL},
    {"time-unit", "text or NumPy files", NULL},
    {"column-order", "text or NumPy files", NULL},
    {"width", "files that may lack a sensor size", NULL},
    {"height", "files that may lack a sensor size", NULL},
};

/* Part to convert, in seconds after the start of a recording. */
static gdouble from_seconds;
static gdouble to_seconds = G_MAXDOUBLE;
static gchar* crop_text;
static struct { guint width, height, x, y; } region;

static gchar* output_directory;
static gchar* output_extension;
static gchar** files;
static gboolean print_version;

static const GOptionEntry options[] = {
    {"format", 'f', 0, G_OPTION_ARG_STRING, &properties[0].value,
     "Encoding of a .raw file, or dialect of a .csv or .txt file", "NAME"},
    {"compression", 'c', 0, G_OPTION_ARG_STRING, &properties[1].value,
     "Compression of an .aedat4, .h5 or .mcap file", "NAME"},
    {"time-unit", 'u', 0, G_OPTION_ARG_STRING, &properties[2].value,
     "Time unit of a text or NumPy file that is read", "NAME"},
    {"column-order", 'o', 0, G_OPTION_ARG_STRING, &properties[3].value,
     "Columns of a text or NumPy file that is read, such as txyp", "LETTERS"},
    {"width", 0, 0, G_OPTION_ARG_STRING, &properties[4].value,
     "Width of the sensor, if IN does not state it", "PIXELS"},
    {"height", 0, 0, G_OPTION_ARG_STRING, &properties[5].value,
     "Height of the sensor, if IN does not state it", "PIXELS"},
    {"from", 0, 0, G_OPTION_ARG_DOUBLE, &from_seconds,
     "Start of the part to convert, counted from the start of IN", "SECONDS"},
    {"to", 0, 0, G_OPTION_ARG_DOUBLE, &to_seconds,
     "End of the part to convert, exclusive, counted from the start of IN", "SECONDS"},
    {"crop", 0, 0, G_OPTION_ARG_STRING, &crop_text,
     "Convert only a region of the sensor, whose first pixel becomes (0, 0)", "WIDTHxHEIGHT+X+Y"},
    {"output-directory", 0, 0, G_OPTION_ARG_FILENAME, &output_directory,
     "Convert each IN to a file of the same name in this folder", "DIRECTORY"},
    {"extension", 0, 0, G_OPTION_ARG_STRING, &output_extension,
     "Extension of the files in the output directory, by default that of IN", "NAME"},
    {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &files, NULL, NULL},
    {"version", 0, 0, G_OPTION_ARG_NONE, &print_version, "Print the version", NULL},
    G_OPTION_ENTRY_NULL,
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

static void append_names(GString* text, const char* what, const char* factory,
                         const char* property) {
  g_autoptr(GstElement) element = gst_element_factory_make(factory, NULL);
  if (element == NULL) return; /* built without it */
  gst_object_ref_sink(element);
  g_autofree gchar* names = names_of(G_OBJECT(element), property);
  g_string_append_printf(text, "  --%s, %s:%s\n", property, what, names);
}

/* Part of --help after the options. */
static gchar* help(void) {
  GString* text = g_string_new(
      "IN is recognised by its content, or else by its extension. Formats, by the extension of "
      "OUT:\n");
  for (gsize i = 0; i < G_N_ELEMENTS(formats); ++i)
    g_string_append_printf(text, "  %-8s %s\n", formats[i].extension, formats[i].description);
  g_string_append(text, "\nNames that options accept:\n");
  append_names(text, ".raw", "evtenc", "format");
  append_names(text, ".csv and .txt", "eventcsvenc", "format");
  append_names(text, ".aedat4", "aedatmux", "compression");
  append_names(text, ".h5", "eventhdf5sink", "compression");
  append_names(text, ".mcap", "eventmcapenc", "format");
  append_names(text, ".mcap", "eventmcapenc", "compression");
  append_names(text, "text and NumPy", "eventcsvdec", "time-unit");
  g_string_append(text, "  --extension, all:");
  for (gsize i = 0; i < G_N_ELEMENTS(formats); ++i)
    if (formats[i].writer != NULL) g_string_append_printf(text, " %s", formats[i].extension + 1);
  g_string_append_c(text, '\n');
  g_string_append(text, "\nExit status: 0 = converted, 1 = failed or interrupted, 2 = wrong usage");
  return g_string_free(text, FALSE);
}

/* Format selected by a file's extension, or NULL. */
static const Format* format_of(const char* path) {
  for (gsize i = 0; i < G_N_ELEMENTS(formats); ++i) {
    const gsize length = strlen(formats[i].extension);
    if (strlen(path) > length &&
        g_ascii_strcasecmp(path + strlen(path) - length, formats[i].extension) == 0)
      return &formats[i];
  }
  return NULL;
}

static const Reader* reader_of(const char* media_type) {
  for (gsize i = 0; i < G_N_ELEMENTS(readers); ++i)
    if (strcmp(media_type, readers[i].media_type) == 0) return &readers[i];
  return NULL;
}

/* False, with an error printed, for a pipe or device: what is read from it to recognise it would be
 * lost. Opening a pipe might wait forever, so this looks before. Files that are missing, and
 * directories, have errors of their own. */
static gboolean can_read_twice(const char* path) {
  struct stat in;
  if (stat(path, &in) != 0 || S_ISREG(in.st_mode) || S_ISDIR(in.st_mode)) return TRUE;
  PRINT_ERROR("%s is not a regular file; save it to a file first\n", path);
  return FALSE;
}

/* The reader of a file, by its content, or by its extension if the content is ambiguous. Prints
 * an error and returns NULL if there is none. */
static const Reader* find_reader(const char* path) {
  static const char matlab[] = "MATLAB 5.0 MAT-file";
  static guint8 start[1 << 14];
  const Format* format = format_of(path);
  const Reader* reader = NULL;
  if (!can_read_twice(path)) return NULL;
  FILE* file = fopen(path, "rb");
  const gsize size = file != NULL ? fread(start, 1, sizeof start, file) : 0;
  if (file == NULL || ferror(file)) {
    PRINT_ERROR("%s: %s\n", path, g_strerror(errno));
    if (file != NULL) fclose(file);
    return NULL;
  }
  fclose(file);
  g_autoptr(GstCaps) caps =
      size > 0 ? gst_type_find_helper_for_data(NULL, start, size, NULL) : NULL;
  if (caps != NULL) reader = reader_of(gst_structure_get_name(gst_caps_get_structure(caps, 0)));
  if (reader == NULL && format != NULL) reader = reader_of(format->media_type);
  if (reader == NULL && size > strlen(matlab) && memcmp(start, matlab, strlen(matlab)) == 0)
    PRINT_ERROR("%s: files of MATLAB are not read; docs/formats.md has a line that exports them\n",
                path);
  else if (reader == NULL)
    PRINT_ERROR("%s: neither its content nor its extension matches a known format; see --help\n",
                path);
  return reader;
}

/* True if files can be written in this format. */
static gboolean can_write(const char* path, const Format* format) {
  struct stat out;
  const gboolean exists = stat(path, &out) == 0;
  if (exists && S_ISDIR(out.st_mode)) {
    PRINT_ERROR("%s is a directory; name a file in it\n", path);
    return FALSE;
  }
  if (exists && !S_ISREG(out.st_mode)) {
    PRINT_ERROR("%s is not a regular file, and would be replaced; name a file\n", path);
    return FALSE;
  }
  if (format == NULL) {
    PRINT_ERROR("%s: unknown extension; known are", path);
    for (gsize i = 0; i < G_N_ELEMENTS(formats); ++i)
      if (formats[i].writer != NULL) PRINT_ERROR(" %s", formats[i].extension);
    PRINT_ERROR("\n");
    return FALSE;
  }
  if (format->writer == NULL) {
    PRINT_ERROR("%s files can only be read\n", format->extension);
    return FALSE;
  }
  return TRUE;
}

/* True if all given options of the writer apply to the format. */
static gboolean options_apply(const Format* format) {
  for (gsize i = 0; i < G_N_ELEMENTS(properties); ++i) {
    const Option* option = &properties[i];
    if (option->value == NULL || option->inputs != NULL) continue;
    if (format->options != NULL && strstr(format->options, option->name) != NULL) continue;
    PRINT_ERROR("--%s does not apply to %s files\n", option->name, format->extension);
    return FALSE;
  }
  return TRUE;
}

/* Sets a property to the value of an option. */
static gboolean set_option(GstElement* element, const Option* option) {
  GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(element), option->name);
  if (spec == NULL) {
    PRINT_ERROR("--%s applies only to reading %s\n", option->name, option->inputs);
    return FALSE;
  }
  if (G_IS_PARAM_SPEC_ENUM(spec)) {
    const GEnumValue* value =
        g_enum_get_value_by_nick(G_PARAM_SPEC_ENUM(spec)->enum_class, option->value);
    if (value == NULL) {
      g_autofree gchar* names = names_of(G_OBJECT(element), option->name);
      PRINT_ERROR("--%s: no \"%s\"; choose one of%s\n", option->name, option->value, names);
      return FALSE;
    }
    g_object_set(element, option->name, value->value, NULL);
  } else if (G_IS_PARAM_SPEC_UINT(spec)) {
    const GParamSpecUInt* range = G_PARAM_SPEC_UINT(spec);
    guint64 number = 0;
    g_autoptr(GError) error = NULL;
    if (!g_ascii_string_to_unsigned(option->value, 10, range->minimum, range->maximum, &number,
                                    &error)) {
      PRINT_ERROR("--%s: %s\n", option->name, error->message);
      return FALSE;
    }
    g_object_set(element, option->name, (guint)number, NULL);
  } else {
    g_object_set(element, option->name, option->value, NULL);
  }
  return TRUE;
}

/* Sets the properties given by options. */
static gboolean set_options(GstElement* pipeline) {
  for (gsize i = 0; i < G_N_ELEMENTS(properties); ++i) {
    const Option* option = &properties[i];
    if (option->value == NULL) continue;
    g_autoptr(GstElement) element =
        gst_bin_get_by_name(GST_BIN(pipeline), option->inputs != NULL ? "reader" : "writer");
    if (!set_option(element, option)) return FALSE;
  }
  return TRUE;
}

/* Writing starts before reading ends, so it would destroy the input. */
static gboolean same_file(const char* a, const char* b) {
  struct stat of_a, of_b;
  return stat(a, &of_a) == 0 && stat(b, &of_b) == 0 && of_a.st_dev == of_b.st_dev &&
         of_a.st_ino == of_b.st_ino;
}

/* Creates a file next to OUT to write to, so that only a complete file replaces an existing one.
 * NULL on failure. */
static gchar* create_part(const char* path) {
  for (int i = 1; i < 1000; ++i) {
    g_autofree gchar* part =
        i == 1 ? g_strconcat(path, ".part", NULL) : g_strdup_printf("%s.part%d", path, i);
    const int file = open(part, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file >= 0) {
      close(file);
      return g_steal_pointer(&part);
    }
    if (errno != EEXIST) break;
  }
  PRINT_ERROR("%s cannot be written: %s\n", path, g_strerror(errno));
  return NULL;
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

static void link_when_known(GstElement* pipeline, const Format* to) {
  g_autoptr(GstElement) reader = gst_bin_get_by_name(GST_BIN(pipeline), "reader");
  g_autoptr(GstElement) writer = gst_bin_get_by_name(GST_BIN(pipeline), "writer");
  /* Frames are not cropped, so they would not match the events. */
  const gboolean takes_frames =
      crop_text == NULL && strcmp(to->media_type, "application/x-aedat") == 0;
  g_signal_connect(reader, "no-more-pads", G_CALLBACK(link_streams), takes_frames ? writer : NULL);
}

static GstStructure* stats_of(GstElement* pipeline, const char* name) {
  g_autoptr(GstElement) element = gst_bin_get_by_name(GST_BIN(pipeline), name);
  GstStructure* stats = NULL;
  g_object_get(element, "stats", &stats, NULL);
  return stats;
}

/* What is converted. */
typedef struct {
  guint64 events;
  gboolean labelled; /* some events have labels */
} Content;

/* True if a format keeps labels. */
static gboolean keeps_labels(const Format* to) {
  return strcmp(to->extension, ".npz") == 0 || strcmp(to->extension, ".h5") == 0 ||
         g_strcmp0(properties[0].value, "labels") == 0;
}

/* Prints what OUT cannot store of `in`. */
static void print_left_out(const char* in, GstElement* pipeline, gboolean labels) {
  static const struct {
    const char* field;
    const char* name;
  } kinds[] = {{"frames", "frames"}, {"triggers", "triggers"}, {"imu-samples", "IMU samples"}};
  g_autoptr(GstStructure) read = stats_of(pipeline, "reader");
  g_autoptr(GstStructure) written = stats_of(pipeline, "writer");
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
  if (labels) g_string_append(text, text->len > 0 ? ", labels" : "labels");
  if (text->len > 0) PRINT_ERROR("%s: left out: %s\n", in, text->str);
}

/* Warns that the part of `in` had no events. */
static void print_empty(const char* in, GstElement* pipeline) {
  gint64 duration = 0;
  PRINT_ERROR("%s: warning: no events in this part", in);
  if (gst_element_query_duration(pipeline, GST_FORMAT_TIME, &duration))
    PRINT_ERROR("; the recording lasts %.6g s", (gdouble)duration / GST_SECOND);
  PRINT_ERROR("\n");
}

/* Runs in the streaming thread, while the main thread prints. */
static GstPadProbeReturn count_events(GstPad* pad, GstPadProbeInfo* info, gpointer data) {
  Content* content = data;
  (void)pad;
  if ((info->type & GST_PAD_PROBE_TYPE_BUFFER) != 0) {
    GstBuffer* buffer = GST_PAD_PROBE_INFO_BUFFER(info);
    __atomic_add_fetch(&content->events, gst_buffer_get_size(buffer) / 8, __ATOMIC_RELAXED);
    if (gst_buffer_get_event_camera_label_meta(buffer) != NULL)
      __atomic_store_n(&content->labelled, TRUE, __ATOMIC_RELAXED);
  } else if (GST_EVENT_TYPE(GST_PAD_PROBE_INFO_EVENT(info)) == GST_EVENT_FLUSH_STOP) {
    __atomic_store_n(&content->events, 0, __ATOMIC_RELAXED); /* the file starts over */
    __atomic_store_n(&content->labelled, FALSE, __ATOMIC_RELAXED);
  }
  return GST_PAD_PROBE_OK;
}

/* Time of a pipeline at an option's seconds. */
static gint64 nanoseconds(gdouble seconds) {
  return (gint64)(seconds * GST_SECOND + 0.5);
}

/* Parses WIDTHxHEIGHT+X+Y. FALSE if the text is invalid. */
static gboolean set_region(const char* text) {
  /* Alone, sscanf() would take signs and spaces. */
  static const char form[] = "^[0-9]{1,5}x[0-9]{1,5}[+][0-9]{1,5}[+][0-9]{1,5}\\z";
  return g_regex_match_simple(form, text, 0, 0) &&
         sscanf(text, "%5ux%5u+%5u+%5u", &region.width, &region.height, &region.x, &region.y) ==
             4 &&
         region.width > 0 && region.height > 0 &&
         region.x + region.width <= GST_EVENT_CAMERA_MAX_SIDE &&
         region.y + region.height <= GST_EVENT_CAMERA_MAX_SIDE;
}

/* Makes `crop` keep the region, once the size of the sensor is known. Runs in the streaming thread.
 */
static GstPadProbeReturn set_crop(GstPad* pad, GstPadProbeInfo* info, gpointer crop) {
  GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
  GstCaps* caps;
  GstEventCameraInfo sensor;
  (void)pad;
  if (GST_EVENT_TYPE(event) != GST_EVENT_CAPS) return GST_PAD_PROBE_OK;
  gst_event_parse_caps(event, &caps);
  if (!gst_event_camera_info_from_caps(&sensor, caps) ||
      region.x + region.width > (guint)sensor.width ||
      region.y + region.height > (guint)sensor.height) {
    GST_ELEMENT_ERROR(crop, STREAM, FORMAT,
                      ("The region %ux%u+%u+%u is not within the sensor.", region.width,
                       region.height, region.x, region.y),
                      ("%" GST_PTR_FORMAT, (void*)caps));
    return GST_PAD_PROBE_DROP;
  }
  g_object_set(crop, "left", region.x, "right", (guint)sensor.width - region.x - region.width,
               "top", region.y, "bottom", (guint)sensor.height - region.y - region.height, NULL);
  return GST_PAD_PROBE_OK;
}

/* True if only a part of the time is converted. */
static gboolean is_trimmed(void) {
  return from_seconds > 0 || to_seconds < G_MAXDOUBLE;
}

/* True if only a part of the time or of the sensor is converted. */
static gboolean is_part(void) {
  return is_trimmed() || crop_text != NULL;
}

/* Makes a reader that knows its file start over at the first time and end at the last, and plays.
 * FALSE on failure. */
static gboolean trim(const char* in, GstElement* pipeline) {
  const gboolean ends = to_seconds < G_MAXDOUBLE;
  g_autoptr(GstElement) reader = gst_bin_get_by_name(GST_BIN(pipeline), "reader");
  const gboolean ok = gst_element_seek(
      reader, 1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE, GST_SEEK_TYPE_SET,
      nanoseconds(from_seconds), ends ? GST_SEEK_TYPE_SET : GST_SEEK_TYPE_NONE,
      ends ? nanoseconds(to_seconds) : -1);
  if (ok)
    gst_element_set_state(pipeline, GST_STATE_PLAYING);
  else
    PRINT_ERROR("%s cannot be sought, so --from and --to do not apply\n", in);
  return ok;
}

/* Prints a bar that is overwritten on a terminal, or one line per second elsewhere. */
static void print_progress(GstElement* pipeline, guint64 events) {
  static const char full[] = "########################################";
  gint64 position = 0;
  gint64 duration = 0;
  if (!gst_element_query_position(pipeline, GST_FORMAT_TIME, &position) ||
      !gst_element_query_duration(pipeline, GST_FORMAT_TIME, &duration) || duration <= 0)
    return;
  const gdouble start = from_seconds * GST_SECOND;
  const gdouble end = MIN((gdouble)duration, to_seconds * GST_SECOND);
  const gdouble share = CLAMP(((gdouble)position - start) / (end - start), 0.0, 1.0);
  if (isatty(STDERR_FILENO))
    PRINT_ERROR("\r[%-40.*s] %3.0f %%, %" G_GUINT64_FORMAT " events", (int)(40 * share), full,
                100 * share, events);
  else
    PRINT_ERROR("%3.0f %%, %" G_GUINT64_FORMAT " events\n", 100 * share, events);
}

static void clear_progress(void) {
  if (isatty(STDERR_FILENO)) PRINT_ERROR("\r\033[K");
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
  PRINT_ERROR("%s: %s: %s\n", in, kind, error->message);
  const gchar* cause = debug != NULL ? strchr(debug, '\n') : NULL;
  if (cause != NULL && cause[1] != '\0') PRINT_ERROR("  %s\n", cause + 1);
}

static volatile sig_atomic_t interrupted;

/* The first Ctrl-C completes the file with the events so far; the second kills the program. */
static void interrupt(int number) {
  interrupted = 1;
  signal(number, SIG_DFL);
}

/* Runs until the file is written. FALSE on failure. */
static gboolean run(const char* in, const Format* to, GstElement* pipeline,
                    const Content* content) {
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline);
  gboolean trimming = is_trimmed();
  gboolean ended = FALSE;
  gboolean ending = FALSE;
  gboolean ok = TRUE;
  gst_element_set_state(pipeline, trimming ? GST_STATE_PAUSED : GST_STATE_PLAYING);
  while (!ended) {
    if (interrupted && !ending && !trimming) {
      ending = TRUE;
      gst_element_send_event(pipeline, gst_event_new_eos());
    }
    g_autoptr(GstMessage) message =
        gst_bus_timed_pop_filtered(bus, GST_SECOND,
                                   GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING |
                                       GST_MESSAGE_INFO | GST_MESSAGE_ASYNC_DONE);
    if (message == NULL) {
      print_progress(pipeline, __atomic_load_n(&content->events, __ATOMIC_RELAXED));
      continue;
    }
    if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ASYNC_DONE) {
      if (trimming) ok = trim(in, pipeline);
      trimming = FALSE;
      ended = !ok;
    } else {
      ended = (GST_MESSAGE_TYPE(message) & (GST_MESSAGE_EOS | GST_MESSAGE_ERROR)) != 0;
      ok = GST_MESSAGE_TYPE(message) != GST_MESSAGE_ERROR;
      if (GST_MESSAGE_TYPE(message) != GST_MESSAGE_EOS) print_message(in, message);
    }
  }
  clear_progress();
  if (ok) print_left_out(in, pipeline, content->labelled && !keeps_labels(to));
  if (ok && !interrupted && content->events == 0 && is_part()) print_empty(in, pipeline);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  return ok;
}

/* Renames the file if it is complete. FALSE if it is not. */
static gboolean finish(const char* part, const char* path, gboolean ok) {
  if (!ok) {
    remove(part);
  } else if (interrupted && access(path, F_OK) == 0) {
    PRINT_ERROR("interrupted: %s is unchanged; the events so far are in %s\n", path, part);
  } else if (rename(part, path) != 0) {
    PRINT_ERROR("%s: %s; the events are in %s\n", path, g_strerror(errno), part);
    ok = FALSE;
  } else if (interrupted) {
    PRINT_ERROR("interrupted: %s has the events so far\n", path);
  }
  return ok && !interrupted;
}

/* OUT or, if it is a symbolic link, its target, so that the link is kept. NULL if that is missing.
 */
static gchar* target_of(const char* path) {
  if (!g_file_test(path, G_FILE_TEST_IS_SYMLINK)) return g_strdup(path);
  gchar* target = realpath(path, NULL);
  if (target == NULL) PRINT_ERROR("%s: target of the link: %s\n", path, g_strerror(errno));
  return target;
}

/* A pipeline that reads `in` and writes `part`, and tells its content. NULL, and the exit status,
 * on failure. */
static GstElement* make_pipeline(const char* in, const Reader* from, const char* part,
                                 const Format* to, Content* content, int* status) {
  g_autoptr(GError) error = NULL;
  g_autofree gchar* line = g_strdup_printf(
      "filesrc name=in ! %s name=reader %s queue name=events ! %s %s", from->element,
      from->has_streams ? "" : "!", crop_text != NULL ? "eventcrop name=crop !" : "", to->writer);
  g_autoptr(GstElement) pipeline =
      gst_parse_launch_full(line, NULL, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (pipeline == NULL) {
    PRINT_ERROR("%s\n", error->message);
    *status = 1;
    return NULL;
  }
  if (!set_options(pipeline)) {
    *status = 2;
    return NULL;
  }
  set_location(pipeline, "in", in);
  set_location(pipeline, "out", part);
  g_autoptr(GstElement) last =
      gst_bin_get_by_name(GST_BIN(pipeline), crop_text != NULL ? "crop" : "events");
  if (crop_text != NULL) {
    g_autoptr(GstPad) sink = gst_element_get_static_pad(last, "sink");
    gst_pad_add_probe(sink, GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, set_crop, last, NULL);
  }
  g_autoptr(GstPad) pad = gst_element_get_static_pad(last, "src");
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_FLUSH, count_events,
                    content, NULL);
  if (from->has_streams) link_when_known(pipeline, to);
  return g_steal_pointer(&pipeline);
}

/* Returns the exit status. */
static int write_file(const char* in, const Reader* from, const char* path, const Format* to) {
  Content content = {0, FALSE};
  int status = 0;
  g_autofree gchar* part = create_part(path);
  if (part == NULL) return 1;
  g_autoptr(GstElement) pipeline = make_pipeline(in, from, part, to, &content, &status);
  if (pipeline == NULL) {
    remove(part);
    return status;
  }
  if (!finish(part, path, run(in, to, pipeline, &content))) return 1;
  printf("%" G_GUINT64_FORMAT " events from %s to %s\n", content.events, in, path);
  return 0;
}

/* Messages of a bag of ROS 2 that SQLite has not yet moved to the file are in a journal beside it.
 */
static void warn_of_journal(const char* in) {
  g_autofree gchar* journal = g_strconcat(in, "-wal", NULL);
  struct stat found;
  if (g_str_has_suffix(in, ".db3") && stat(journal, &found) == 0 && found.st_size > 0)
    PRINT_ERROR(
        "%s: warning: messages in %s are not read; run: sqlite3 %s 'PRAGMA wal_checkpoint'\n", in,
        journal, in);
}

/* Returns the exit status. */
static int convert(const char* in, const char* out) {
  const Format* to = format_of(out);
  if (!can_write(out, to)) return 2;
  const Reader* from = find_reader(in);
  if (from == NULL) return 1;
  if (!options_apply(to)) return 2;
  if (same_file(in, out)) {
    PRINT_ERROR("%s and %s are the same file\n", in, out);
    return 2;
  }
  g_autofree gchar* path = target_of(out);
  if (path == NULL) return 1;
  warn_of_journal(in);
  return write_file(in, from, path, to);
}

/* Path of the converted file in the output directory. */
static gchar* output_of(const char* in) {
  g_autofree gchar* name = g_path_get_basename(in);
  if (output_extension == NULL) return g_build_filename(output_directory, name, NULL);
  const gchar* dot = strrchr(name, '.');
  const int length = (int)(dot != NULL && dot != name ? dot - name : (gssize)strlen(name));
  const char* extension = output_extension + (output_extension[0] == '.');
  return g_strdup_printf("%s/%.*s.%s", output_directory, length, name, extension);
}

/* True if no two files would become the same. */
static gboolean are_distinct(gchar** outputs) {
  for (gsize i = 0; outputs[i] != NULL; ++i)
    for (gsize j = 0; j < i; ++j)
      if (strcmp(outputs[i], outputs[j]) == 0) {
        PRINT_ERROR("%s and %s would both become %s\n", files[j], files[i], outputs[i]);
        return FALSE;
      }
  return TRUE;
}

/* Converts each file; a failure does not stop the others. Returns the exit status. */
static int convert_all(void) {
  g_auto(GStrv) outputs = g_new0(gchar*, g_strv_length(files) + 1);
  for (gsize i = 0; files[i] != NULL; ++i) outputs[i] = output_of(files[i]);
  if (!are_distinct(outputs)) return 2;
  if (g_mkdir_with_parents(output_directory, 0777) != 0) {
    PRINT_ERROR("%s: %s\n", output_directory, g_strerror(errno));
    return 1;
  }
  int status = 0;
  for (gsize i = 0; files[i] != NULL && !interrupted; ++i) {
    const int outcome = convert(files[i], outputs[i]);
    status = MAX(status, outcome);
  }
  return status;
}

/* Returns the error in the options and file names, or NULL. */
static const char* misuse(void) {
  const guint count = files != NULL ? g_strv_length(files) : 0;
  if (output_directory == NULL && count != 2) return "needs IN and OUT";
  if (output_directory != NULL && count == 0) return "needs IN";
  if (output_directory == NULL && output_extension != NULL)
    return "--extension needs --output-directory";
  if (!(from_seconds >= 0 && from_seconds < to_seconds && from_seconds < 1e9))
    return "--from must be at least 0 and less than --to";
  if (to_seconds < G_MAXDOUBLE && to_seconds >= 1e9) return "--to must be less than 1e9";
  if (crop_text != NULL && !set_region(crop_text))
    return "--crop needs WIDTHxHEIGHT+X+Y, such as 320x240+100+50";
  return NULL;
}

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  g_autoptr(GOptionContext) context = g_option_context_new("IN OUT - converts event files");
  g_autofree gchar* text = help();
  g_option_context_set_description(context, text);
  g_option_context_add_main_entries(context, options, NULL);
  g_autoptr(GError) error = NULL;
  const gboolean ok = g_option_context_parse(context, &argc, &argv, &error);
  if (ok && print_version) {
    printf("event-convert %s\n", PACKAGE_VERSION);
    return 0;
  }
  const char* wrong = ok ? misuse() : error->message;
  if (wrong != NULL) {
    PRINT_ERROR("%s; see %s --help\n", wrong, g_get_prgname());
    return 2;
  }
  if (!find_plugin()) return 1;
  signal(SIGINT, interrupt);
  return output_directory != NULL ? convert_all() : convert(files[0], files[1]);
}
