/* SPDX-License-Identifier: LGPL-2.1-or-later
 *
 * The formats of event files, and the elements that read and write them. */
#pragma once

#include <glib.h>

G_BEGIN_DECLS

typedef struct {
  const char* media_type;
  const char* element;
  gboolean has_streams; /* a pad for each: events_0, video_0, ... */
} Reader;

typedef struct {
  const char* extension;
  const char* description;
  const char* media_type;
  const char* writer;  /* an element name=writer; NULL if the format is read-only */
  const char* options; /* writer properties that options can set, or NULL */
} Format;

/* Ends with an extension that is NULL. */
extern const Format formats[];

/* Format selected by a file's extension, or NULL. */
const Format* format_of(const char* path);

/* The reader of a file, by its content, or by its extension if the content is ambiguous. Prints
 * an error and returns NULL if there is none. */
const Reader* find_reader(const char* path);

/* FALSE, with an error printed, if a file cannot be written in this format. NULL is that of an
 * unknown extension. */
gboolean can_write(const char* path, const Format* format);

G_END_DECLS
