/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "file_formats.h"

#include <errno.h>
#include <gst/base/gsttypefindhelper.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

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

const Format formats[] = {
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
    {".mcap", "MCAP, a ROS 2 bag", "application/x-mcap",
     "eventmcapenc name=writer ! filesink name=out", "format compression"},
    {".bin", "N-MNIST and N-Caltech101, read only", "application/x-atis-bin", NULL, NULL},
    {".bag", "ROS 1 bag, read only", "application/x-rosbag", NULL, NULL},
    {".db3", "ROS 2 bag with SQLite, read only", "application/x-rosbag2-db3", NULL, NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

const Format* format_of(const char* path) {
  for (const Format* format = formats; format->extension != NULL; ++format) {
    const gsize length = strlen(format->extension);
    if (strlen(path) > length &&
        g_ascii_strcasecmp(path + strlen(path) - length, format->extension) == 0)
      return format;
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
  fprintf(stderr, "%s is not a regular file; save it to a file first\n", path);
  return FALSE;
}

const Reader* find_reader(const char* path) {
  static const char matlab[] = "MATLAB 5.0 MAT-file";
  static guint8 start[1 << 14];
  const Format* format = format_of(path);
  const Reader* reader = NULL;
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
  if (caps != NULL) reader = reader_of(gst_structure_get_name(gst_caps_get_structure(caps, 0)));
  if (reader == NULL && format != NULL) reader = reader_of(format->media_type);
  if (reader == NULL && size > strlen(matlab) && memcmp(start, matlab, strlen(matlab)) == 0)
    fprintf(stderr,
            "%s: files of MATLAB are not read; docs/formats.md has a line that exports them\n",
            path);
  else if (reader == NULL)
    fprintf(stderr,
            "%s: neither its content nor its extension matches a known format; see --help\n", path);
  return reader;
}

gboolean can_write(const char* path, const Format* format) {
  struct stat out;
  const gboolean exists = stat(path, &out) == 0;
  if (exists && S_ISDIR(out.st_mode)) {
    fprintf(stderr, "%s is a directory; name a file in it\n", path);
    return FALSE;
  }
  if (exists && !S_ISREG(out.st_mode)) {
    fprintf(stderr, "%s is not a regular file, and would be replaced; name a file\n", path);
    return FALSE;
  }
  if (format == NULL) {
    fprintf(stderr, "%s: unknown extension; known are", path);
    for (const Format* known = formats; known->extension != NULL; ++known)
      if (known->writer != NULL) fprintf(stderr, " %s", known->extension);
    fprintf(stderr, "\n");
    return FALSE;
  }
  if (format->writer == NULL) {
    fprintf(stderr, "%s files can only be read\n", format->extension);
    return FALSE;
  }
  return TRUE;
}
