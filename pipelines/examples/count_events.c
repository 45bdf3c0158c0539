/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * Example of reading events in C: runs a pipeline and counts the events that reach its appsink.
 *
 *   count_events "videotestsrc pattern=ball num-buffers=90 ! eventsim-dvs ! appsink name=events"
 *
 * To build it outside this project:
 *   cc count_events.c $(pkg-config --cflags --libs gsteventcamera-1.0 gstreamer-app-1.0)
 */
#include <gst/app/gstappsink.h>
#include <gst/eventcamera/eventcamera.h>
#include <signal.h>
#include <string.h>

typedef struct {
  guint64 events;
  guint64 on;
} Count;

static void print(const char* what, const Count* count, gdouble seconds) {
  g_print("%s %9" G_GUINT64_FORMAT " events, %.2f Mev/s, %2.0f %% ON\n", what, count->events,
          seconds > 0 ? (gdouble)count->events / seconds / 1e6 : 0.0,
          count->events > 0 ? 100.0 * (gdouble)count->on / (gdouble)count->events : 0.0);
}

static void count_buffer(Count* count, GstBuffer* buffer) {
  GstEventCameraMap map;
  if (!gst_event_camera_map(&map, buffer)) return;
  /* map.events is an array; an event's time in microseconds is map.start + t. */
  for (gsize i = 0; i < map.n_events; ++i)
    count->on += gst_event_camera_event_is_on(&map.events[i]) ? 1 : 0;
  count->events += map.n_events;
  gst_event_camera_unmap(&map);
}

/* Prints the error that stopped the pipeline, if any, and its cause: the last line of the debug
 * text. Returns TRUE if there was one. */
static gboolean failed(GstBus* bus) {
  GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR);
  GError* error = NULL;
  gchar* debug = NULL;
  const gchar* cause;
  if (message == NULL) return FALSE;
  gst_message_parse_error(message, &error, &debug);
  cause = debug != NULL ? strrchr(debug, '\n') : NULL;
  g_printerr("%s: %s %s\n", GST_OBJECT_NAME(GST_MESSAGE_SRC(message)), error->message,
             cause != NULL ? cause + 1 : "");
  g_free(debug);
  g_clear_error(&error);
  gst_message_unref(message);
  return TRUE;
}

/* Prints the size of the sensor or, for caps of other streams, how to get events. */
static gboolean check_caps(const GstCaps* caps) {
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps)) {
    g_printerr(
        "The appsink receives %s, not events. Insert a simulator (! eventsim-dvs ! appsink "
        "name=events) or, for an event file, use: decodebin "
        "caps=\"application/x-event-camera,format=XYTP\" ! appsink name=events\n",
        gst_structure_get_name(gst_caps_get_structure(caps, 0)));
    return FALSE;
  }
  g_print("Events of a %dx%d sensor\n", info.width, info.height);
  return TRUE;
}

static volatile sig_atomic_t is_interrupted = FALSE;

/* A second Ctrl-C ends the program. */
static void interrupt(int number) {
  is_interrupted = TRUE;
  signal(number, SIG_DFL);
}

/* Counts events until the end of the stream, and prints a line per second of stream time. Ctrl-C
 * sends EOS, so that sinks complete their files. */
static gboolean count_stream(GstElement* pipeline, GstAppSink* sink, GstBus* bus) {
  Count all = {0, 0};
  Count second = {0, 0};
  GstClockTime start = GST_CLOCK_TIME_NONE;
  GstClockTime printed = 0;
  GstClockTime end = 0;

  while (!gst_app_sink_is_eos(sink)) {
    GstSample* sample = gst_app_sink_try_pull_sample(sink, GST_SECOND / 10);
    GstBuffer* buffer;
    if (is_interrupted) {
      is_interrupted = FALSE;
      gst_element_send_event(pipeline, gst_event_new_eos());
    }
    if (sample == NULL) {
      if (failed(bus)) return FALSE;
      continue;
    }
    buffer = gst_sample_get_buffer(sample);
    if (start == GST_CLOCK_TIME_NONE) {
      if (!check_caps(gst_sample_get_caps(sample))) {
        gst_sample_unref(sample);
        return FALSE;
      }
      start = printed = GST_BUFFER_PTS(buffer);
    }
    count_buffer(&second, buffer);
    end = GST_BUFFER_PTS(buffer) + GST_BUFFER_DURATION(buffer);
    if (end - printed >= GST_SECOND) {
      print("  ", &second, (gdouble)(end - printed) / GST_SECOND);
      all.events += second.events;
      all.on += second.on;
      second = (Count){0, 0};
      printed = end;
    }
    gst_sample_unref(sample);
  }
  all.events += second.events;
  all.on += second.on;
  print("Total", &all, start == GST_CLOCK_TIME_NONE ? 0 : (gdouble)(end - start) / GST_SECOND);
  return !failed(bus);
}

int main(int argc, char** argv) {
  GError* error = NULL;
  GstElement* pipeline;
  GstElement* sink;
  GstBus* bus;
  gboolean ok;

  gst_init(&argc, &argv);
  if (argc != 2) {
    g_printerr("usage: %s PIPELINE, with an appsink name=events in it\n", argv[0]);
    return 2;
  }
  pipeline = gst_parse_launch_full(argv[1], NULL, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (pipeline == NULL) {
    g_printerr("%s\n", error->message);
    g_clear_error(&error);
    return 2;
  }
  sink = GST_IS_BIN(pipeline) ? gst_bin_get_by_name(GST_BIN(pipeline), "events") : NULL;
  if (sink == NULL || !GST_IS_APP_SINK(sink)) {
    g_printerr("The pipeline has no appsink name=events; end it in: ! appsink name=events\n");
    gst_clear_object(&sink);
    gst_object_unref(pipeline);
    return 2;
  }
  signal(SIGINT, interrupt);
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  bus = gst_element_get_bus(pipeline);
  ok = count_stream(pipeline, GST_APP_SINK(sink), bus);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(bus);
  gst_object_unref(sink);
  gst_object_unref(pipeline);
  return ok ? 0 : 1;
}
