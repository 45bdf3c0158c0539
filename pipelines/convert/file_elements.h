/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * The elements that read and write event files, which GStreamer's registry knows by their
 * metadata, and the options that set their properties. */
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS

typedef struct {
  GstElementFactory* factory;
  gchar* extension; /* of files, with its dot */
  gchar* settings;  /* properties to set for this extension, as in a launch line */
} FileElement;

/* One for each extension, in alphabetical order. Ends with a factory that is NULL. */
const FileElement* file_readers(void);
const FileElement* file_writers(void);

/* The element with the extension of a path, or NULL. */
const FileElement* with_extension_of(const FileElement* elements, const char* path);

/* The reader of a file, by its content, or by its extension if the content is ambiguous. Prints
 * an error and returns NULL if there is none. */
const FileElement* find_reader(const char* path);

/* The writer of a file, by its extension. Prints an error and returns NULL if there is none, or the
 * file cannot be replaced. */
const FileElement* find_writer(const char* path);

enum {
  OPTION_FORMAT,
  OPTION_COMPRESSION,
  OPTION_TIME_UNIT,
  OPTION_COLUMN_ORDER,
  OPTION_WIDTH,
  OPTION_HEIGHT,
  OPTION_COUNT
};

/* Values of the options; NULL if not given. */
typedef struct {
  gchar* values[OPTION_COUNT];
} ElementOptions;

/* Appends a line for each option and extension with the values that the element accepts. */
void append_accepted_values(GString* text);

/* FALSE, with an error printed, if the writer lacks the property of an option. */
gboolean options_apply(const ElementOptions* options, const FileElement* writer);

/* Sets the properties of the elements "reader" and "writer" of a pipeline. FALSE, with an error
 * printed, if a value is invalid. */
gboolean set_options(const ElementOptions* options, GstElement* pipeline);

G_END_DECLS
