// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "src/formats/decoder.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/numpy/npy_header.hpp"

namespace eventcamera {

/// Reads NumPy's format, versions 1.0 to 3.0: a structured array with fields t, x, y and p in any
/// order, each an integer or floating-point number of any width and byte order. A floating-point t
/// is in seconds, an integer one in microseconds. Polarity is ON where it is more than 0.
class NpyDecoder final : public Decoder {
 public:
  /// The file does not tell the sensor's size; where it is 0x0 no event is outside.
  explicit NpyDecoder(SensorSize size = {}) {
    size_ = size;
    validator_.set_size(size);
  }

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override;
  void finish(Decoded& out) override;

 private:
  bool take_header(std::span<const std::uint8_t>& bytes);
  void read_elements(const std::uint8_t* bytes, std::uint64_t count, Decoded& out);

  bool header_read_ = false;
  NpyHeader header_;
  bool plain_ = false;  ///< all fields are little-endian integers, 8 bytes or more together
  std::vector<std::uint8_t> rest_;  ///< of the header, or the beginning of an element
  std::uint64_t position_ = 0;      ///< of what is read next
  std::uint64_t left_ = 0;          ///< elements that the header claims and that have not come
  bool after_end_ = false;
  RowValidator validator_;
};

}  // namespace eventcamera
