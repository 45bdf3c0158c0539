// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_table.hpp"

#include <iterator>
#include <utility>

#include "src/formats/corruption.hpp"
#include "src/formats/hdf5/hdf5_dataset.hpp"

namespace eventcamera {

namespace {

/// Base of tables whose events are plain numbers.
class NumberTable : public Hdf5Table {
 public:
  std::uint64_t read(std::uint64_t row, RowValidator& validator, std::vector<AbsoluteEvent>& out,
                     Corruption& corruption) override {
    auto end = block_end(row, rows_);
    const auto* unread = read_numbers(row, end - row);
    if (unread != nullptr) {
      end = std::min(end, chunk_end(row));
      unread = read_numbers(row, end - row);
    }
    if (unread != nullptr) {
      note(corruption, *unread, row, "unreadable part of an HDF5 dataset");
      return end;
    }
    if (wraps_ && row != next_row_) clock_.restore(unwrapped(row, t_.front()));
    next_row_ = end;
    for (std::size_t i = 0; i < t_.size(); ++i) {
      Microseconds t = wraps_ ? clock_.follow(static_cast<std::uint32_t>(t_[i])) : t_[i];
      if (__builtin_add_overflow(t, offset_, &t)) {
        note(corruption, t_dataset(), row, "timestamp out of range");
        continue;
      }
      const auto on = polarities_.is_on(p_[i]);
      if (!on) {
        note(corruption, t_dataset(), row, "polarity other than 0, 1 and -1");
        continue;
      }
      const auto label = has_labels_ ? label_from(cause_[i], object_class_[i]) : Label{};
      validator.append(t, x_[i], y_[i], *on, label, out, corruption);
    }
    return end;
  }

  std::uint64_t row_before(Microseconds t) override {
    // Treats unreadable rows as late, so that no event is skipped.
    return first_row(rows_, [&](std::uint64_t row) {
      const auto time = time_at(row);
      return time && *time < t;
    });
  }

  std::optional<Microseconds> time_at(std::uint64_t row) override {
    Microseconds t = 0;
    const auto number = row < rows_ ? time_number(row) : std::nullopt;
    if (!number || __builtin_add_overflow(unwrapped(row, *number), offset_, &t))
      return std::nullopt;
    return t;
  }

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
                  bool are_floating, const std::string& path) {
    if (!sample.empty()) polarities_ = sample.find_polarities(columns);
    if (unit) return *unit;
    if (sample.empty()) return are_floating ? TimeUnit::seconds : TimeUnit::microseconds;
    unit = sample.find_unit(columns, false);
    if (!unit)
      throw UnsupportedFormat("the time unit of the HDF5 dataset " + path +
                              " is ambiguous; set time-unit, or name the times t_s, t_us or t_ns");
    return *unit;
  }

  /// First row after the chunk of this row.
  virtual std::uint64_t chunk_end(std::uint64_t row) const = 0;

  /// Unwraps the time of a row, `number`; without the offset.
  virtual Microseconds unwrapped(std::uint64_t row, std::int64_t number) {
    if (!wraps_) return number;
    if (samples_.empty()) read_samples();
    auto clock = std::prev(std::ranges::upper_bound(samples_, row, {}, &Sample::row))->clock;
    return clock.follow(static_cast<std::uint32_t>(number));
  }

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

  /// Time of a row as stored in the file.
  std::optional<std::int64_t> time_number(std::uint64_t row) {
    std::vector<std::int64_t> numbers;
    if (!t_dataset().read(row, 1, numbers)) return std::nullopt;
    return numbers[t_column()];
  }

  /// Samples the clock along the file. Samples must be less than half a wrap, 35 minutes, apart.
  void read_samples() {
    constexpr std::uint64_t max_samples = 256;
    const auto steps = std::clamp<std::uint64_t>(rows_, 2, max_samples) - 1;
    Clock clock;
    samples_.push_back({0, clock});
    for (std::uint64_t i = 0; i <= steps; ++i) {
      const auto row = i < steps ? i * (rows_ / steps) : rows_ - 1;
      const auto number = time_number(row);
      if (!number) continue;
      clock.follow(static_cast<std::uint32_t>(*number));
      samples_.push_back({row, clock});
    }
  }

  std::vector<Sample> samples_;  ///< read on first use
  std::uint64_t next_row_ = 0;
  Clock clock_;  ///< before next_row_
};

class RowTable final : public NumberTable {
 public:
  RowTable(Hdf5Format format, Hdf5Dataset events, const std::string& path, SensorSize size,
           std::optional<ColumnOrder> order, std::optional<TimeUnit> unit)
      : NumberTable(format), events_(std::move(events)) {
    events_.require_filters();
    size_ = size;
    rows_ = events_.rows();
    claimed_rows_ = events_.claimed_rows();
    TableSample sample;
    std::vector<TableSample::Row> rows;
    if (events_.sample(std::min(sample_rows(), events_.chunk_end(0)), rows))
      for (auto& row : rows) sample.add(std::move(row));
    Columns columns(event_columns);
    if (order) {
      for (std::size_t i = 0; i < event_columns; ++i)
        columns[(*order)[i]] = static_cast<EventColumn>(i);
    } else {
      const auto found = sample.find_columns();
      if (!found || found->size() != event_columns)
        throw UnsupportedFormat("unknown columns in the HDF5 dataset " + path +
                                "; set column-order, or store datasets named t, x, y and p");
      columns = *found;
    }
    for (std::size_t i = 0; i < event_columns; ++i)
      order_[static_cast<std::size_t>(*columns[i])] = i;
    if (!unit && events_.rank() == 2 && events_.is_unsigned_32()) unit = TimeUnit::microseconds;
    const auto detected = detect(sample, columns, unit, !events_.is_integers(), path);
    events_.set_unit(order_[0], detected);
    wraps_ = events_.rank() == 2 && events_.is_unsigned_32() && detected == TimeUnit::microseconds;
  }

 protected:
  Hdf5Dataset& t_dataset() override { return events_; }
  std::size_t t_column() const override { return order_[0]; }

  const Hdf5Dataset* read_numbers(std::uint64_t row, std::uint64_t count) override {
    if (!events_.read(row, count, numbers_)) return &events_;
    std::vector<std::int64_t>* const separate[] = {&t_, &x_, &y_, &p_};
    for (std::size_t column = 0; column < event_columns; ++column) {
      separate[column]->resize(count);
      for (std::size_t i = 0; i < count; ++i)
        (*separate[column])[i] = numbers_[i * event_columns + order_[column]];
    }
    return nullptr;
  }

  std::uint64_t chunk_end(std::uint64_t row) const override { return events_.chunk_end(row); }

 private:
  Hdf5Dataset events_;
  ColumnOrder order_ = {};
  std::vector<std::int64_t> numbers_;
};

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

std::unique_ptr<Hdf5Table> make_row_table(Hdf5Format format, Hdf5Dataset events,
                                          const std::string& path, SensorSize size,
                                          std::optional<ColumnOrder> order,
                                          std::optional<TimeUnit> unit) {
  return std::make_unique<RowTable>(format, std::move(events), path, size, order, unit);
}

std::unique_ptr<Hdf5Table> make_dsec_table(hid_t file, const ColumnDatasets& datasets) {
  return std::make_unique<DsecTable>(file, datasets);
}

}  // namespace eventcamera
