// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/hdf5/hdf5_decoder.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

/// Events of an HDF5 file of any layout, as rows.
class Hdf5Table {
 public:
  virtual ~Hdf5Table() = default;
  Hdf5Table(const Hdf5Table&) = delete;
  Hdf5Table& operator=(const Hdf5Table&) = delete;

  /// Throws UnsupportedFormat if the layout is unknown or invalid, or there are no such events.
  static std::unique_ptr<Hdf5Table> open(hid_t file, const Hdf5Selection& selection);

  SensorSize size() const { return size_; }
  bool has_labels() const { return has_labels_; }
  bool is_metavision() const { return is_metavision_; }
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
  Hdf5Table() = default;

  SensorSize size_;
  bool has_labels_ = false;
  bool is_metavision_ = false;  ///< the layout of Metavision
  std::uint64_t rows_ = 0, claimed_rows_ = 0;
  std::string others_;  ///< paths of other events in the file
};

}  // namespace eventcamera
