// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/row_table.hpp"

#include <algorithm>
#include <utility>

#include "src/formats/hdf5/number_table.hpp"
#include "src/formats/unsupported_format.hpp"

namespace eventcamera {

namespace {

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

}  // namespace

std::unique_ptr<Hdf5Table> make_row_table(Hdf5Format format, Hdf5Dataset events,
                                          const std::string& path, SensorSize size,
                                          std::optional<ColumnOrder> order,
                                          std::optional<TimeUnit> unit) {
  return std::make_unique<RowTable>(format, std::move(events), path, size, order, unit);
}

}  // namespace eventcamera
