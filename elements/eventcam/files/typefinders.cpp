// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/gst.h>

#include <algorithm>

#include "src/formats/recognition.hpp"

using eventcamera::FileKind;

/// Peeks at the part at the start of the file that recognise() examines.
static std::span<const guint8> first_bytes(GstTypeFind* find) {
  constexpr guint64 max_bytes = eventcamera::max_recognised_bytes;
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

template <FileKind kind>
static void find_kind(GstTypeFind* find, gpointer media_type) {
  const auto found = eventcamera::recognise(first_bytes(find), kind);
  if (!found || found->kind != kind) return;
  const auto probability = found->certain ? GST_TYPE_FIND_MAXIMUM : GST_TYPE_FIND_NEARLY_CERTAIN;
  const auto* const name = static_cast<const char*>(media_type);
  if (kind == FileKind::aedat)
    gst_type_find_suggest_simple(find, probability, name, "version", G_TYPE_INT, found->version,
                                 nullptr);
  else
    gst_type_find_suggest_empty_simple(find, probability, name);
}

/// Registers a typefinder that suggests caps of `media_type`.
#define REGISTER(name, kind, media_type, extensions, rank)                                     \
  GST_TYPE_FIND_REGISTER_DEFINE(name, media_type, rank, find_kind<FileKind::kind>, extensions, \
                                nullptr, const_cast<char*>(media_type), nullptr)

REGISTER(aedat, aedat, "application/x-aedat", "aedat,aedat4", GST_RANK_PRIMARY)
// Without the extension .bin: it would do where the content does not.
REGISTER(atisbin, atis_bin, "application/x-atis-bin", nullptr, GST_RANK_SECONDARY)
REGISTER(eventcsv, csv, "application/x-event-csv", "csv,txt",
         GST_RANK_SECONDARY)  // after formats with a signature
REGISTER(eventstream, event_stream, "application/x-es", "es", GST_RANK_PRIMARY)
REGISTER(hdf5, hdf5, "application/x-hdf5", "h5,hdf5", GST_RANK_PRIMARY)
REGISTER(mcap, mcap, "application/x-mcap", "mcap", GST_RANK_PRIMARY)
REGISTER(npy, npy, "application/x-npy", "npy", GST_RANK_PRIMARY)
REGISTER(npz, npz, "application/x-npz", "npz", GST_RANK_PRIMARY)
REGISTER(propheseedat, prophesee_dat, "application/x-prophesee-dat", "dat", GST_RANK_PRIMARY)
REGISTER(propheseeraw, prophesee_raw, "application/x-prophesee-raw", "raw", GST_RANK_PRIMARY)
REGISTER(rosbag, rosbag, "application/x-rosbag", "bag", GST_RANK_PRIMARY)
REGISTER(rosbag2, rosbag2_db3, "application/x-rosbag2-db3", "db3", GST_RANK_PRIMARY)
