// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/pad_bytes.hpp"

#include <algorithm>

#include "gst/base/pulling.hpp"

/// Pulled at once: upstream allocates as much.
static constexpr std::size_t piece_bytes = std::size_t{1} << 20;

PadBytes::PadBytes(GstPad* sink, GstFlowReturn& stop)
    : sink_(sink), stop_(stop), size_(upstream_bytes(sink)) {}

bool PadBytes::read(std::uint64_t position, std::span<std::uint8_t> out) noexcept {
  while (!out.empty()) {
    const auto wanted = std::min(out.size(), piece_bytes);
    GstBuffer* piece = nullptr;
    const GstFlowReturn result =
        gst_pad_pull_range(sink_, position, static_cast<guint>(wanted), &piece);
    if (result != GST_FLOW_OK) {
      stop_ = result;
      return false;
    }
    const gsize got = gst_buffer_extract(piece, 0, out.data(), wanted);
    gst_buffer_unref(piece);
    if (got == 0) {
      stop_ = GST_FLOW_EOS;
      return false;
    }
    position += got;
    out = out.subspan(got);
  }
  return true;
}
