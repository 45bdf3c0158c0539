// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/file_extensions.hpp"

#include <string>

#include "gst/base/owned.hpp"
#include "src/formats/file_formats.hpp"

using namespace eventcamera;

/// Sets `key` to a field of each format of the caps, joined by `separator`.
static void set_extensions(GstElementClass* klass, const char* key, const char* caps,
                           const char* FileFormat::*field, const char* separator) {
  const OwnedCaps types(gst_caps_from_string(caps));
  std::string text;
  for (guint i = 0; i < gst_caps_get_size(types.get()); ++i) {
    const auto* const name = gst_structure_get_name(gst_caps_get_structure(types.get(), i));
    const auto* const format = file_format_of(name);
    if (format == nullptr) continue;  // words without a header
    if (!text.empty()) text += separator;
    text += format->*field;
  }
  gst_element_class_add_metadata(klass, key, text.c_str());
}

void set_input_extensions(GstElementClass* klass, const char* caps) {
  set_extensions(klass, "input-extensions", caps, &FileFormat::extensions, ",");
}

void set_output_extensions(GstElementClass* klass, const char* caps) {
  set_extensions(klass, "output-extensions", caps, &FileFormat::written, "; ");
}
