/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * Counts ON and OFF events; the same in C, Python and JavaScript.
 *
 *   cc on_and_off.c $(pkg-config --cflags --libs gsteventcamera-1.0 gstreamer-app-1.0)
 */
#include <gst/app/gstappsink.h>
#include <gst/eventcamera/eventcamera.h>

int main(int argc, char** argv) {
  guint64 on = 0, events = 0;
  GError* error = NULL;
  GstElement *pipeline, *sink;
  GstSample* sample;

  gst_init(&argc, &argv);
  pipeline = gst_parse_launch(
      "videotestsrc pattern=ball num-buffers=40 ! eventsim-dvs ! appsink name=events sync=false",
      &error);
  if (error != NULL) {
    g_printerr("%s\n", error->message);
    return 1;
  }
  sink = gst_bin_get_by_name(GST_BIN(pipeline), "events");
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  while ((sample = gst_app_sink_pull_sample(GST_APP_SINK(sink))) != NULL) {
    GstEventCameraInfo info;
    GstEventCameraMap map;
    if (!gst_event_camera_info_from_caps(&info, gst_sample_get_caps(sample))) {
      g_printerr(
          "The appsink receives no events; insert a simulator or a reader: "
          "! eventsim-dvs ! appsink\n");
      return 1;
    }
    if (events == 0) g_print("Events of a %dx%d sensor\n", info.width, info.height);
    if (gst_event_camera_map(&map, gst_sample_get_buffer(sample))) {
      for (gsize i = 0; i < map.n_events; ++i) on += gst_event_camera_event_is_on(&map.events[i]);
      events += map.n_events;
      gst_event_camera_unmap(&map);
    }
    gst_sample_unref(sample);
  }
  g_print("%" G_GUINT64_FORMAT " ON, %" G_GUINT64_FORMAT " OFF\n", on, events - on);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(sink);
  gst_object_unref(pipeline);
  return 0;
}
