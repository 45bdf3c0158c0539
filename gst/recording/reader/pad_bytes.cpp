// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/reader/pad_bytes.hpp"

#include <algorithm>
#include <utility>

/// Limits on a single pull, because upstream allocates a buffer of that size.
static constexpr std::size_t piece_size = std::size_t{1} << 18;
static constexpr std::size_t max_read = std::size_t{1} << 20;

guint64 upstream_bytes(GstPad* sink) {
  gint64 size = 0;
  const bool known = gst_pad_peer_query_duration(sink, GST_FORMAT_BYTES, &size) != FALSE;
  return known && size > 0 ? static_cast<guint64>(size) : 0;
}

/// Returns null at the end of the file and if reading fails, or ends because upstream got EOS.
GstBuffer* PadBytes::pull(std::uint64_t position, std::size_t size) noexcept {
  GstBuffer* buffer = nullptr;
  const GstFlowReturn result =
      gst_pad_pull_range(sink_, position, static_cast<guint>(size), &buffer);
  if (result != GST_FLOW_EOS || position < upstream_bytes(sink_)) flow_ = result;
  return result == GST_FLOW_OK ? buffer : nullptr;
}

std::optional<std::size_t> PadBytes::read(std::uint64_t position,
                                          std::span<std::uint8_t> out) noexcept {
  std::size_t filled = 0;
  while (filled < out.size()) {
    const auto wanted = std::min(out.size() - filled, max_read);
    const OwnedBuffer buffer(pull(position + filled, wanted));
    if (failed()) return std::nullopt;
    const gsize got = buffer ? gst_buffer_extract(buffer.get(), 0, out.data() + filled, wanted) : 0;
    if (got == 0) break;
    filled += got;
  }
  return filled;
}

std::optional<std::span<const std::uint8_t>> PadBytes::piece(std::uint64_t position) {
  piece_.reset();
  OwnedBuffer buffer(pull(position, piece_size));
  if (failed()) return std::nullopt;
  if (!buffer) return std::span<const std::uint8_t>{};
  piece_.emplace(GST_PAD_PARENT(sink_), std::move(buffer));
  if (piece_->is_mapped()) return piece_->get();
  flow_ = GST_FLOW_ERROR;
  return std::nullopt;
}
