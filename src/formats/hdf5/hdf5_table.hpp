// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/hdf5/hdf5_dataset.hpp"
#include "src/formats/hdf5/hdf5_format.hpp"
#include "src/formats/table_sample.hpp"
#include "src/formats/unwrapped_clock.hpp"

namespace eventcamera {

/// Sensor size in the attributes of a group or file; 0x0 if there is none.
SensorSize size_of_attributes(hid_t object);

/// Events of an HDF5 file of any layout, as rows.
class Hdf5Table {
 public:
  virtual ~Hdf5Table() = default;
  Hdf5Table(const Hdf5Table&) = delete;
  Hdf5Table& operator=(const Hdf5Table&) = delete;

  /// Throws UnsupportedFormat if the layout is unknown or invalid, or there are no such events.
  static std::unique_ptr<Hdf5Table> open(hid_t file, const Hdf5Selection& selection);

  Hdf5Format format() const { return format_; }
  SensorSize size() const { return size_; }
  bool has_labels() const { return has_labels_; }
  std::uint64_t rows() const { return rows_; }
  std::uint64_t claimed_rows() const { return claimed_rows_; }
  const std::string& others() const { return others_; }

  /// Reads a bounded number of rows from `row` on, and returns the row after them. Skips corrupt
  /// data and records it in `corruption`.
  virtual std::uint64_t read(std::uint64_t row, RowValidator& validator,
                             std::vector<AbsoluteEvent>& out, Corruption& corruption) = 0;

  /// Returns a row close to `t`; all rows before it are earlier than `t`.
  virtual std::uint64_t row_before(Microseconds t) = 0;

  virtual std::optional<Microseconds> time_at(std::uint64_t row) = 0;

 protected:
  explicit Hdf5Table(Hdf5Format format) : format_(format) {}

  Hdf5Format format_;
  SensorSize size_;
  bool has_labels_ = false;
  std::uint64_t rows_ = 0, claimed_rows_ = 0;
  std::string others_;  ///< paths of other events in the file
};

/// Column numbers of t, x, y and p.
using ColumnOrder = std::array<std::size_t, event_columns>;

/// Creates the table of a dataset with the numbers of each event in a row: v2e, MVSEC, Metavision
/// without compression, and others. Detects the order and the unit unless they are known. Throws
/// UnsupportedFormat.
std::unique_ptr<Hdf5Table> make_row_table(Hdf5Format format, Hdf5Dataset events,
                                          const std::string& path, SensorSize size,
                                          std::optional<ColumnOrder> order,
                                          std::optional<TimeUnit> unit);

/// Datasets of a group that hold the columns t, x, y and p.
struct ColumnDatasets {
  std::string group;                 ///< empty or with a final slash
  std::array<std::string, 4> names;  ///< by EventColumn
  std::optional<TimeUnit> unit;      ///< in the name of the times
  std::optional<TimeUnit> set_unit;  ///< by the user
};

/// Creates the table of columns: the DSEC layout, and others without its index. Throws
/// UnsupportedFormat.
std::unique_ptr<Hdf5Table> make_dsec_table(hid_t file, const ColumnDatasets& datasets);

}  // namespace eventcamera
