// SPDX-License-Identifier: LGPL-2.1-or-later

#include <algorithm>
#include <span>
#include <vector>

#include "gst/base/owned.hpp"
#include "src/formats/compressed_file.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/file_formats.hpp"

using namespace eventcamera;

/// Peeks at up to `max_bytes` at the start of the file.
static std::span<const guint8> first_bytes(GstTypeFind* find, guint64 max_bytes) {
  const guint64 length = gst_type_find_get_length(find);
  const auto limit = static_cast<guint>(length > 0 ? std::min(length, max_bytes) : max_bytes);
  // The length may be unknown, and a peek past the end returns nothing, so extend it by halves.
  std::span<const guint8> bytes;
  for (guint step = limit; step > 0 && bytes.size() < limit; step /= 2) {
    const auto count = static_cast<guint>(bytes.size()) + step;
    if (const guint8* peeked = gst_type_find_peek(find, 0, count)) bytes = {peeked, count};
  }
  return bytes;
}

/// Decompresses the part at the start of a file that likelihood() examines.
static std::vector<guint8> decompressed(std::span<const guint8> start) {
  std::vector<guint8> content;
  FileDecompressor decompressor;
  decompressor.push(start);
  try {
    for (auto part = decompressor.next(); !part.empty() && content.size() < max_recognised_bytes;
         part = decompressor.next())
      content.insert(content.end(), part.begin(), part.end());
  } catch (const UnsupportedFormat&) {
  }
  return content;
}

static guint probability(Likelihood likelihood) {
  switch (likelihood) {
    case Likelihood::none:
      return GST_TYPE_FIND_NONE;
    case Likelihood::possible:
      return GST_TYPE_FIND_NEARLY_CERTAIN - 1;
    case Likelihood::high:
      return GST_TYPE_FIND_NEARLY_CERTAIN;
    case Likelihood::certain:
      return GST_TYPE_FIND_MAXIMUM;
  }
  return GST_TYPE_FIND_NONE;
}

static void find_format(GstTypeFind* find, gpointer data) {
  const auto& format = *static_cast<const FileFormat*>(data);
  // Zstandard outputs a block only at its end, and typefinders see no more than this.
  constexpr guint64 max_compressed = 1U << 17;
  auto bytes = first_bytes(find, max_recognised_bytes);
  std::vector<guint8> content;
  if (FileDecompressor::is_compressed(bytes)) {
    content = decompressed(first_bytes(find, max_compressed));
    bytes = content;
  }
  const auto found = probability(likelihood(format, bytes));
  if (found == GST_TYPE_FIND_NONE) return;
  if (format.version != nullptr)
    gst_type_find_suggest_simple(find, found, format.media_type, "version", G_TYPE_INT,
                                 format.version(bytes), nullptr);
  else
    gst_type_find_suggest_empty_simple(find, found, format.media_type);
}

/// Registers a typefinder for each format, named after its media type.
static gboolean register_typefinders(GstPlugin* plugin) {
  gboolean registered = FALSE;
  for (const auto& format : file_formats()) {
    const OwnedCaps caps(gst_caps_new_empty_simple(format.media_type));
    registered |= gst_type_find_register(
        plugin, format.media_type, format.has_signature ? GST_RANK_PRIMARY : GST_RANK_SECONDARY,
        find_format, format.has_signature ? format.extensions : nullptr, caps.get(),
        const_cast<FileFormat*>(&format), nullptr);
  }
  return registered;
}

GST_TYPE_FIND_REGISTER_DEFINE_CUSTOM(event_files, register_typefinders)
