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
#include <gst/eventcamera/eventcamera.h>
#include <gst/gst.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "../plugin.h"
#include "conversion.h"
#include "file_elements.h"

/* Text is printed unchanged by stdio: names are bytes, messages are UTF-8. g_print() would replace
 * characters that the locale lacks. */

static ElementOptions element_options;
static Part part = {.to = G_MAXDOUBLE};
static gchar* crop_text;
static gchar* output_directory;
static gchar* output_extension;
static gchar** files;
static gboolean print_version;

static const GOptionEntry options[] = {
    {"format", 'f', 0, G_OPTION_ARG_STRING, &element_options.values[OPTION_FORMAT],
     "Encoding of a .raw or .mcap file, dialect of text, or layout of HDF5", "NAME"},
    {"compression", 'c', 0, G_OPTION_ARG_STRING, &element_options.values[OPTION_COMPRESSION],
     "Compression of an .aedat4, .h5 or .mcap file", "NAME"},
    {"time-unit", 'u', 0, G_OPTION_ARG_STRING, &element_options.values[OPTION_TIME_UNIT],
     "Time unit of a text, NumPy or HDF5 file that is read", "NAME"},
    {"column-order", 'o', 0, G_OPTION_ARG_STRING, &element_options.values[OPTION_COLUMN_ORDER],
     "Columns of a text, NumPy or HDF5 file that is read, such as txyp", "LETTERS"},
    {"width", 0, 0, G_OPTION_ARG_STRING, &element_options.values[OPTION_WIDTH],
     "Width of the sensor, if IN does not state it", "PIXELS"},
    {"height", 0, 0, G_OPTION_ARG_STRING, &element_options.values[OPTION_HEIGHT],
     "Height of the sensor, if IN does not state it", "PIXELS"},
    {"from", 0, 0, G_OPTION_ARG_DOUBLE, &part.from,
     "Start of the part to convert, counted from the start of IN", "SECONDS"},
    {"to", 0, 0, G_OPTION_ARG_DOUBLE, &part.to,
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

/* Appends a line about files with an extension. */
static void append_file(GString* text, const FileElement* element, const char* note) {
  const gchar* description =
      gst_element_factory_get_metadata(element->factory, GST_ELEMENT_METADATA_DESCRIPTION);
  g_string_append_printf(text, note[0] != '\0' ? "  %-8s %s (%s)\n" : "  %-8s %s\n",
                         element->extension, description, note);
}

/* Part of --help after the options. */
static gchar* help(void) {
  GString* text = g_string_new(
      "IN is recognised by its content, or else by its extension. Formats, by the extension of "
      "OUT:\n");
  for (const FileElement* writer = file_writers(); writer->factory != NULL; ++writer)
    append_file(text, writer, writer->settings);
  for (const FileElement* reader = file_readers(); reader->factory != NULL; ++reader)
    if (with_extension_of(file_writers(), reader->extension) == NULL)
      append_file(text, reader, "read only");
  g_string_append(text, "\nNames that options accept:\n");
  append_accepted_values(text);
  g_string_append(text, "  --extension, all:");
  for (const FileElement* writer = file_writers(); writer->factory != NULL; ++writer)
    g_string_append_printf(text, " %s", writer->extension + 1);
  g_string_append_c(text, '\n');
  g_string_append(text, "\nExit status: 0 = converted, 1 = failed or interrupted, 2 = wrong usage");
  return g_string_free(text, FALSE);
}

/* Writing starts before reading ends, so it would destroy the input. */
static gboolean same_file(const char* a, const char* b) {
  struct stat of_a, of_b;
  return stat(a, &of_a) == 0 && stat(b, &of_b) == 0 && of_a.st_dev == of_b.st_dev &&
         of_a.st_ino == of_b.st_ino;
}

/* Creates a file next to OUT to write to, so that only a complete file replaces an existing one.
 * NULL on failure. */
static gchar* create_unfinished(const char* path) {
  for (int i = 1; i < 1000; ++i) {
    g_autofree gchar* unfinished =
        i == 1 ? g_strconcat(path, ".part", NULL) : g_strdup_printf("%s.part%d", path, i);
    const int file = open(unfinished, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file >= 0) {
      close(file);
      return g_steal_pointer(&unfinished);
    }
    if (errno != EEXIST) break;
  }
  fprintf(stderr, "%s cannot be written: %s\n", path, g_strerror(errno));
  return NULL;
}

/* Renames the file if it is complete. FALSE if it is not. */
static gboolean finish(const char* unfinished, const char* path, gboolean ok) {
  if (!ok) {
    remove(unfinished);
  } else if (was_interrupted() && access(path, F_OK) == 0) {
    fprintf(stderr, "interrupted: %s is unchanged; the events so far are in %s\n", path,
            unfinished);
  } else if (rename(unfinished, path) != 0) {
    fprintf(stderr, "%s: %s; the events are in %s\n", path, g_strerror(errno), unfinished);
    ok = FALSE;
  } else if (was_interrupted()) {
    fprintf(stderr, "interrupted: %s has the events so far\n", path);
  }
  return ok && !was_interrupted();
}

/* OUT or, if it is a symbolic link, its target, so that the link is kept. NULL if that is missing.
 */
static gchar* target_of(const char* path) {
  if (!g_file_test(path, G_FILE_TEST_IS_SYMLINK)) return g_strdup(path);
  gchar* target = realpath(path, NULL);
  if (target == NULL) fprintf(stderr, "%s: target of the link: %s\n", path, g_strerror(errno));
  return target;
}

/* Returns the exit status. */
static int write_file(const char* in, const FileElement* reader, const char* path,
                      const FileElement* writer) {
  guint64 events = 0;
  g_autofree gchar* unfinished = create_unfinished(path);
  if (unfinished == NULL) return 1;
  const int status =
      convert_events(in, reader, unfinished, writer, &element_options, &part, &events);
  if (!finish(unfinished, path, status == 0)) return MAX(status, 1);
  printf("%" G_GUINT64_FORMAT " events from %s to %s\n", events, in, path);
  return 0;
}

/* Messages of a ROS 2 bag that SQLite has not yet moved to the file are in a journal beside it.
 */
static void warn_of_journal(const char* in) {
  g_autofree gchar* journal = g_strconcat(in, "-wal", NULL);
  struct stat found;
  if (g_str_has_suffix(in, ".db3") && stat(journal, &found) == 0 && found.st_size > 0)
    fprintf(stderr,
            "%s: warning: messages in %s are not read; run: sqlite3 %s 'PRAGMA wal_checkpoint'\n",
            in, journal, in);
}

/* Returns the exit status. */
static int convert(const char* in, const char* out) {
  const FileElement* writer = find_writer(out);
  if (writer == NULL) return 2;
  const FileElement* reader = find_reader(in);
  if (reader == NULL) return 1;
  if (!options_apply(&element_options, writer)) return 2;
  if (same_file(in, out)) {
    fprintf(stderr, "%s and %s are the same file\n", in, out);
    return 2;
  }
  g_autofree gchar* path = target_of(out);
  if (path == NULL) return 1;
  warn_of_journal(in);
  return write_file(in, reader, path, writer);
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
        fprintf(stderr, "%s and %s would both become %s\n", files[j], files[i], outputs[i]);
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
    fprintf(stderr, "%s: %s\n", output_directory, g_strerror(errno));
    return 1;
  }
  int status = 0;
  for (gsize i = 0; files[i] != NULL && !was_interrupted(); ++i) {
    const int outcome = convert(files[i], outputs[i]);
    status = MAX(status, outcome);
  }
  return status;
}

/* Parses WIDTHxHEIGHT+X+Y. FALSE if the text is invalid. */
static gboolean parse_region(const char* text, Region* out) {
  /* Alone, sscanf() would take signs and spaces. */
  static const char form[] = "^[0-9]{1,5}x[0-9]{1,5}[+][0-9]{1,5}[+][0-9]{1,5}\\z";
  return g_regex_match_simple(form, text, 0, 0) &&
         sscanf(text, "%5ux%5u+%5u+%5u", &out->width, &out->height, &out->x, &out->y) == 4 &&
         out->width > 0 && out->height > 0 && out->x + out->width <= GST_EVENT_CAMERA_MAX_SIDE &&
         out->y + out->height <= GST_EVENT_CAMERA_MAX_SIDE;
}

/* Returns the error in the options and file names, or NULL. */
static const char* misuse(void) {
  const guint count = files != NULL ? g_strv_length(files) : 0;
  if (output_directory == NULL && count != 2) return "needs IN and OUT";
  if (output_directory != NULL && count == 0) return "needs IN";
  if (output_directory == NULL && output_extension != NULL)
    return "--extension needs --output-directory";
  if (!(part.from >= 0 && part.from < part.to && part.from < 1e9))
    return "--from must be at least 0 and less than --to";
  if (part.to < G_MAXDOUBLE && part.to >= 1e9) return "--to must be less than 1e9";
  if (crop_text != NULL && !parse_region(crop_text, &part.region))
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
    fprintf(stderr, "%s; see %s --help\n", wrong, g_get_prgname());
    return 2;
  }
  if (!find_plugin()) return 1;
  catch_interrupt();
  return output_directory != NULL ? convert_all() : convert(files[0], files[1]);
}
