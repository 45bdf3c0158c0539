// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/dsec_table.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "src/formats/hdf5/hdf5_rows.hpp"
#include "src/formats/hdf5/number_table.hpp"
#include "src/formats/unsupported_format.hpp"

namespace eventcamera {

namespace {

class DsecTable final : public NumberTable {
 public:
  DsecTable(hid_t file, const ColumnDatasets& datasets) : NumberTable(Hdf5Format::dsec) {
    for (const auto& name : datasets.names) columns_.emplace_back(file, datasets.group + name);
    rows_ = columns_[0].rows();
    for (auto& column : columns_) {
      if (column.rank() != 1 || !column.is_numbers())
        throw UnsupportedFormat("HDF5 group /" + datasets.group + " must hold columns of numbers");
      column.require_filters();
      rows_ = std::min(rows_, column.rows());
      claimed_rows_ = std::max(claimed_rows_, column.claimed_rows());
    }
    read_offset(file);
    open_index(file);
    // Nanoseconds of 32 bits would wrap after four seconds.
    auto known = datasets.set_unit;
    if (!known && (index_ || (columns_[0].is_unsigned_32() && !datasets.unit)))
      known = TimeUnit::microseconds;
    const auto unit = detect(read_sample(), *columns_of("txyp"), known ? known : datasets.unit,
                             !columns_[0].is_integers(), datasets.group + datasets.names[0]);
    columns_[0].set_unit(0, unit);
    wraps_ = columns_[0].is_unsigned_32() && unit == TimeUnit::microseconds;
    open_labels(file, datasets.group);
    size_ = size_of_attributes(file);
    if (size_ == SensorSize{} && !datasets.group.empty()) {
      const Hdf5Handle events(H5Gopen2(file, datasets.group.c_str(), H5P_DEFAULT), H5Gclose);
      size_ = size_of_attributes(events.get());
    }
  }

  std::uint64_t row_before(Microseconds t) override {
    Microseconds since = 0;
    if (index_ && !__builtin_sub_overflow(t, offset_, &since) && since >= 0) {
      const auto row = indexed(static_cast<std::uint64_t>(since / 1000));
      // Ignore the index if it is wrong.
      if (row && *row <= rows_ && *row > 0) {
        const auto before = time_at(*row - 1);
        const auto at = time_at(*row);
        if (before && *before < t && (!at || *at >= t - 1000)) return *row;
      }
    }
    return NumberTable::row_before(t);
  }

 protected:
  Hdf5Dataset& t_dataset() override { return columns_[0]; }

  const Hdf5Dataset* read_numbers(std::uint64_t row, std::uint64_t count) override {
    std::vector<std::int64_t>* const numbers[] = {&t_, &x_, &y_, &p_, &cause_, &object_class_};
    for (std::size_t i = 0; i < columns_.size(); ++i)
      if (!columns_[i].read(row, count, *numbers[i])) return &columns_[i];
    return nullptr;
  }

  std::uint64_t chunk_end(std::uint64_t row) const override {
    auto end = rows_;
    for (const auto& column : columns_) end = std::min(end, column.chunk_end(row));
    return end;
  }

  Microseconds unwrapped(std::uint64_t row, std::int64_t number) override {
    if (!index_) return NumberTable::unwrapped(row, number);
    constexpr auto lap = static_cast<Microseconds>(Clock::range);
    if (!wraps_ || index_->rows() <= Clock::range / 1000) return number;
    const auto milliseconds = first_row(index_->rows(), [&](std::uint64_t at) {
      const auto indexed_row = indexed(at);
      return indexed_row && *indexed_row <= row;
    });
    if (milliseconds == 0 || milliseconds > INT64_MAX / 1000) return number;
    const auto about = static_cast<Microseconds>((milliseconds - 1) * 1000);
    return number + std::max<Microseconds>((about - number + lap / 2) / lap, 0) * lap;
  }

 private:
  /// Returns the first rows, up to the end of a chunk; none if they are corrupt.
  TableSample read_sample() {
    TableSample sample;
    std::array<std::vector<TableSample::Row>, event_columns> columns;
    const auto rows = std::min(sample_rows(), chunk_end(0));
    for (std::size_t i = 0; i < event_columns; ++i)
      if (!columns_[i].sample(rows, columns[i])) return sample;
    for (std::size_t row = 0; row < rows; ++row)
      sample.add({columns[0][row][0], columns[1][row][0], columns[2][row][0], columns[3][row][0]});
    return sample;
  }

  /// Opens the columns cause and class, if both are there and have a number for each event.
  void open_labels(hid_t file, const std::string& group) {
    std::vector<Hdf5Dataset> labels;
    for (const char* const name : {"cause", "class"}) {
      if (!Hdf5Dataset::exists(file, group + name, H5O_TYPE_DATASET)) return;
      auto& column = labels.emplace_back(file, group + name);
      if (column.rank() != 1 || !column.is_integers() || column.rows() < rows_) return;
      column.require_filters();
    }
    std::ranges::move(labels, std::back_inserter(columns_));
    has_labels_ = true;
  }

  void read_offset(hid_t file) {
    if (!Hdf5Dataset::exists(file, "t_offset", H5O_TYPE_DATASET)) return;
    Hdf5Dataset offset(file, "t_offset");
    std::vector<std::int64_t> number;
    constexpr Microseconds max_offset = INT64_MAX / 2;
    if (!offset.is_integers() || offset.rows() != 1 || offset.columns() != 1 ||
        !offset.read(0, 1, number) || number[0] > max_offset || number[0] < -max_offset)
      throw UnsupportedFormat("HDF5 dataset /t_offset is not a time");
    offset_ = number[0];
  }

  void open_index(hid_t file) {
    if (!Hdf5Dataset::exists(file, "ms_to_idx", H5O_TYPE_DATASET)) return;
    Hdf5Dataset index(file, "ms_to_idx");
    if (index.rank() != 1 || !index.is_integers()) return;
    index.require_filters();
    index_ = std::move(index);
  }

  std::optional<std::uint64_t> indexed(std::uint64_t milliseconds) {
    std::vector<std::int64_t> row;
    if (milliseconds >= index_->rows() || !index_->read(milliseconds, 1, row) || row[0] < 0)
      return std::nullopt;
    return static_cast<std::uint64_t>(row[0]);
  }

  std::vector<Hdf5Dataset> columns_;  ///< t, x, y and p, and labels
  std::optional<Hdf5Dataset> index_;  ///< first event at or after each millisecond
};

}  // namespace

std::unique_ptr<Hdf5Table> make_dsec_table(hid_t file, const ColumnDatasets& datasets) {
  return std::make_unique<DsecTable>(file, datasets);
}

}  // namespace eventcamera
