// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "src/formats/hdf5/hdf5_table.hpp"
#include "src/formats/table_sample.hpp"
#include "src/formats/unwrapped_clock.hpp"

namespace eventcamera {

/// Base of tables whose events are plain numbers.
class NumberTable : public Hdf5Table {
 public:
  std::uint64_t read(std::uint64_t row, RowValidator& validator, std::vector<AbsoluteEvent>& out,
                     Corruption& corruption) override;
  std::uint64_t row_before(Microseconds t) override;
  std::optional<Microseconds> time_at(std::uint64_t row) override;

 protected:
  using Hdf5Table::Hdf5Table;
  using Clock = UnwrappedClock<32>;

  virtual Hdf5Dataset& t_dataset() = 0;
  virtual std::size_t t_column() const { return 0; }  ///< in the rows of t_dataset()

  /// Reads t_, x_, y_ and p_, and the labels, if there are any. Returns the dataset that could not
  /// be read, or nullptr.
  virtual const Hdf5Dataset* read_numbers(std::uint64_t row, std::uint64_t count) = 0;

  /// Number of rows to sample for detection.
  std::uint64_t sample_rows() const {
    return std::min<std::uint64_t>(rows_, TableSample::max_binary_rows);
  }

  /// Detects the meaning of the polarities, and the time unit unless `unit` is set, which it
  /// returns. Throws UnsupportedFormat if either is ambiguous.
  TimeUnit detect(const TableSample& sample, const Columns& columns, std::optional<TimeUnit> unit,
                  bool are_floating, const std::string& path);

  /// First row after the chunk of this row.
  virtual std::uint64_t chunk_end(std::uint64_t row) const = 0;

  /// Unwraps the time of a row, `number`; without the offset.
  virtual Microseconds unwrapped(std::uint64_t row, std::int64_t number);

  PolarityCode polarities_;
  Microseconds offset_ = 0;
  bool wraps_ = false;  ///< times have 32 bits and wrap after 71 minutes
  std::vector<std::int64_t> t_, x_, y_, p_, cause_, object_class_;

 private:
  /// The clock at a row.
  struct Sample {
    std::uint64_t row;
    Clock clock;
  };

  std::optional<std::int64_t> time_number(std::uint64_t row);
  void read_samples();

  std::vector<Sample> samples_;  ///< read on first use
  std::uint64_t next_row_ = 0;
  Clock clock_;  ///< before next_row_
};

}  // namespace eventcamera
