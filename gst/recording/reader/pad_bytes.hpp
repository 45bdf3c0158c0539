// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "gst/base/buffer_bytes.hpp"
#include "src/formats/byte_source.hpp"

/// Size of the upstream file in bytes; 0 if unknown.
guint64 upstream_bytes(GstPad* sink);

/// Bytes of a file pulled from upstream.
class PadBytes final : public eventcamera::ByteSource {
 public:
  /// `sink` must outlive this object.
  explicit PadBytes(GstPad* sink) : sink_(sink), size_(upstream_bytes(sink)) {}

  std::uint64_t size() const override { return size_; }
  std::optional<std::size_t> read(std::uint64_t position,
                                  std::span<std::uint8_t> out) noexcept override;
  std::optional<std::span<const std::uint8_t>> piece(std::uint64_t position) override;
  bool failed() const noexcept override { return flow_ != GST_FLOW_OK; }

  /// Reason for a failed read; GST_FLOW_EOS if upstream was stopped before the end of the file.
  GstFlowReturn flow() const { return flow_; }

  /// Clears a failed read.
  void retry() { flow_ = GST_FLOW_OK; }

 private:
  GstBuffer* pull(std::uint64_t position, std::size_t size) noexcept;

  GstPad* sink_;
  std::uint64_t size_;
  GstFlowReturn flow_ = GST_FLOW_OK;
  std::optional<MappedBytes> piece_;
};
