/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * Options of the command line that set properties of the elements "reader" and "writer". */
#pragma once

#include <gst/gst.h>

#include "file_formats.h"

G_BEGIN_DECLS

enum {
  OPTION_FORMAT,
  OPTION_COMPRESSION,
  OPTION_TIME_UNIT,
  OPTION_COLUMN_ORDER,
  OPTION_WIDTH,
  OPTION_HEIGHT,
  OPTION_COUNT
};

/* The values that are given; NULL for the others. */
typedef struct {
  gchar* values[OPTION_COUNT];
} ElementOptions;

/* Appends a line with the values that an option accepts: those of the property of an element, if
 * there is such an element. */
void append_accepted_values(GString* text, const char* files, const char* element,
                            const char* property);

/* FALSE, with an error printed, if an option of the writer does not apply to the format. */
gboolean options_apply(const ElementOptions* options, const Format* format);

/* Sets the properties of a pipeline's elements. FALSE, with an error printed, if a value is
 * invalid. */
gboolean set_options(const ElementOptions* options, GstElement* pipeline);

G_END_DECLS
