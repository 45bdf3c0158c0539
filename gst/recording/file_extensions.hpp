// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// Puts the extensions of files into the metadata of an element, where applications find them in
/// GStreamer's registry. `caps` are the media types of the files.
///
/// `input-extensions` of readers: extensions, separated by commas.
void set_input_extensions(GstElementClass* klass, const char* caps);
/// `output-extensions` of writers: as FileFormat::written.
void set_output_extensions(GstElementClass* klass, const char* caps);
