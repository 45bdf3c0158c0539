// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/table.hpp"

#include <algorithm>
#include <mutex>
#include <utility>
#include <vector>

#include "gst/base/pulling.hpp"
#include "src/formats/aedat/aedat4_table.hpp"

namespace aedatdemux {

/// Larger tables, of many days, are not read.
constexpr guint64 max_table = guint64{1} << 26;

/// The bytes of the file from `position` to its end; none where that cannot be.
static std::vector<guint8> pull_rest(GstAedatDemux* self, guint64 position) {
  std::vector<guint8> bytes;
  const guint64 size = upstream_bytes(self->priv->sink);
  if (size <= position || size - position > max_table) return bytes;
  bytes.resize(size - position);
  for (std::size_t at = 0; at < bytes.size();) {
    GstBuffer* piece = nullptr;
    const auto wanted = static_cast<guint>(std::min<std::size_t>(bytes.size() - at, pulled_piece));
    if (gst_pad_pull_range(self->priv->sink, position + at, wanted, &piece) != GST_FLOW_OK)
      return {};
    const gsize got = gst_buffer_extract(piece, 0, bytes.data() + at, wanted);
    gst_buffer_unref(piece);
    if (got == 0) return {};
    at += got;
  }
  return bytes;
}

void seek_table(GstAedatDemux* self) {
  State& state = self->priv->state;
  const auto* const aedat4 = state.reader.aedat4();
  if (aedat4 == nullptr || !aedat4->header_read() || std::exchange(state.table_sought, true))
    return;
  {
    const std::lock_guard lock(self->priv->mutex);
    if (!self->priv->pulls) return;
  }
  const auto at = aedat4->table_at();
  if (!at) return;
  auto table = eventcamera::read_aedat4_table(pull_rest(self, *at), aedat4->compression(),
                                              aedat4->packets_at());
  if (table) {
    state.table = std::move(*table);
    return;
  }
  ++state.counts.corrupt_places;
  state.table_missing = true;
}

void warn_of_missing_table(GstAedatDemux* self) {
  const State& state = self->priv->state;
  // Bytes that are missing before a table have moved it, too.
  if (!state.table_missing || state.reader.corruption().places > 0) return;
  auto& faults = self->priv->faults;
  const auto* const aedat4 = state.reader.aedat4();
  const auto at = aedat4->table_at().value_or(0);
  const auto found_at = aedat4->table_found_at();
  const auto end = upstream_bytes(self->priv->sink);
  if (found_at && *found_at != at)
    faults.warn_of_corruption(aedat4->table_field_at(),
                              "the header names a place without a table of packets");
  else if (end <= at)
    faults.warn_of_corruption(end, "the file ends before its table of packets");
  else
    faults.warn_of_corruption(at, "here should be a table of its packets");
}

}  // namespace aedatdemux
