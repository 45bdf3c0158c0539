/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * A pipeline that converts a file of events. */
#pragma once

#include <gst/gst.h>

#include "file_elements.h"

G_BEGIN_DECLS

typedef struct {
  guint width, height, x, y;
} Region;

/* Part of a recording to convert. */
typedef struct {
  gdouble from, to; /* seconds after its start; to G_MAXDOUBLE for all */
  Region region;    /* of the sensor; without a width for all */
} Part;

/* Converts `in` to the file `out`, which exists, and counts the events. Prints progress, what `out`
 * cannot store, and errors. Returns the exit status. */
int convert_events(const char* in, const FileElement* reader, const char* out,
                   const FileElement* writer, const ElementOptions* options, const Part* part,
                   guint64* events);

/* The first Ctrl-C, SIGTERM or SIGHUP from now on completes the file with the events so far; a
 * second Ctrl-C or SIGTERM kills the program. */
void catch_interrupt(void);
gboolean was_interrupted(void);

G_END_DECLS
