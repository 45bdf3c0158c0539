// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/rtp/gstrtphdrext.h>

#include <algorithm>
#include <memory>
#include <string_view>

#include "gst/base/owned.hpp"

/// Size of the RTP header extensions that a payloader with given caps writes in each packet.
/// GstRTPBasePayload keeps its extensions private (header_exts), so other instances of them are
/// asked.
class RtpHeaderExtensions {
 public:
  /// Maximum size in bytes, with the extensions' common header.
  gsize max_size(const OwnedCaps& caps) {
    if (caps.get() != caps_.get()) {
      size_ = size_of(*gst_caps_get_structure(caps.get(), 0));
      caps_.reset(gst_caps_ref(caps.get()));
    }
    return size_;
  }

 private:
  /// RFC 8285: maximum identifier and size of elements with a one-byte header, and maximum size of
  /// elements with a two-byte header.
  static constexpr guint max_short_id = 14;
  static constexpr gsize max_short_size = 16;
  static constexpr gsize max_long_size = 255;

  static const char* uri_of(const GValue* extmap) {
    if (GST_VALUE_HOLDS_ARRAY(extmap) && gst_value_array_get_size(extmap) > 1)
      extmap = gst_value_array_get_value(extmap, 1);
    return G_VALUE_HOLDS_STRING(extmap) ? g_value_get_string(extmap) : nullptr;
  }

  static gsize size_of(const GstStructure& caps) {
    const OwnedBuffer any(gst_buffer_new());  // extensions may inspect the buffer
    gsize count = 0;
    gsize size = 0;
    bool is_short = true;
    for (gint i = 0; i < gst_structure_n_fields(&caps); ++i) {
      constexpr std::string_view prefix = "extmap-";
      const char* const name = gst_structure_nth_field_name(&caps, static_cast<guint>(i));
      if (!std::string_view(name).starts_with(prefix)) continue;
      const auto id = static_cast<guint>(g_ascii_strtoull(name + prefix.size(), nullptr, 10));
      const char* const uri = uri_of(gst_structure_get_value(&caps, name));
      const std::unique_ptr<GstRTPHeaderExtension, UnrefObject> extension(
          uri != nullptr ? gst_rtp_header_extension_create_from_uri(uri) : nullptr);
      // An application may use an extension that is not registered.
      gsize largest = id <= max_short_id ? max_short_size : max_long_size;
      if (extension) {
        gst_rtp_header_extension_set_id(extension.get(), id);
        largest = gst_rtp_header_extension_get_max_size(extension.get(), any.get());
        is_short &= (gst_rtp_header_extension_get_supported_flags(extension.get()) &
                     GST_RTP_HEADER_EXTENSION_ONE_BYTE) != 0;
      }
      is_short &= id <= max_short_id && largest <= max_short_size;
      size += largest;
      ++count;
    }
    if (count == 0) return 0;
    constexpr gsize header_size = 4;
    constexpr gsize word = 4;
    return header_size + (size + count * (is_short ? 1 : 2) + word - 1) / word * word;
  }

  OwnedCaps caps_;  ///< caps to which the size applies
  gsize size_ = 0;
};
