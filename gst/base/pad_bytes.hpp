// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "src/formats/byte_source.hpp"

/// The bytes of a file that is pulled.
class PadBytes final : public eventcamera::ByteSource {
 public:
  /// Of an element's sink pad. `stop` is told why bytes cannot be read; both outlive this.
  PadBytes(GstPad* sink, GstFlowReturn& stop);

  std::uint64_t size() const override { return size_; }
  bool read(std::uint64_t position, std::span<std::uint8_t> out) noexcept override;

 private:
  GstPad* sink_;
  GstFlowReturn& stop_;
  std::uint64_t size_;
};
