// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"
#include "src/formats/text/csv_dialect.hpp"

namespace eventcamera {

/// Writes lines of text.
class CsvEncoder final : public Encoder {
 public:
  CsvEncoder(const CsvDialect& dialect, SensorSize size) : dialect_(dialect), size_(size) {}

  void encode(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override;
  void finish(std::vector<std::uint8_t>& out) override;

 private:
  std::string header() const;
  void begin(std::vector<std::uint8_t>& out);
  char* write(char* at, Microseconds t) const;
  char* write(char* at, const AbsoluteEvent& event) const;

  CsvDialect dialect_;
  SensorSize size_;
  bool begun_ = false;
};

}  // namespace eventcamera
