// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "src/formats/encoder.hpp"
#include "src/formats/event_table.hpp"

namespace eventcamera {

using ColumnOrder = std::array<EventColumn, 4>;

struct CsvFormat {
  /// Lines before the first event.
  enum class Header : std::uint8_t {
    none,
    names,           ///< t,x,y,p
    names_and_size,  ///< t,x@640,y@480,on
    geometry,        ///< %geometry:640,480
    size,            ///< 640 480
    comment,         ///< # t x y p
  };

  ColumnOrder order = {EventColumn::t, EventColumn::x, EventColumn::y, EventColumn::p};
  char separator = ',';
  TimeUnit unit = TimeUnit::microseconds;
  Header header = Header::names;
  bool minus_one = false;        ///< OFF is -1, else 0
  bool carriage_return = false;  ///< lines end with CR LF
  bool labels = false;           ///< with the columns cause and class of labels
};

struct NamedCsvFormat {
  std::string_view name;
  std::string_view description;
  CsvFormat format;
};

std::span<const NamedCsvFormat> csv_formats();

/// Encodes events as lines of text.
std::unique_ptr<Encoder> make_csv_encoder(const CsvFormat& format, SensorSize size);

}  // namespace eventcamera
