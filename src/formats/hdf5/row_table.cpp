// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/row_table.hpp"

#include <utility>

#include "src/formats/hdf5/number_table.hpp"

namespace eventcamera {

namespace {

class RowTable final : public NumberTable {
 public:
  RowTable(Hdf5Format format, Hdf5Dataset events, SensorSize size, bool wraps,
           const ColumnOrder& order)
      : NumberTable(format), events_(std::move(events)), order_(order) {
    events_.require_filters();
    size_ = size;
    rows_ = events_.rows();
    claimed_rows_ = events_.claimed_rows();
    wraps_ = wraps;
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
  ColumnOrder order_;
  std::vector<std::int64_t> numbers_;
};

}  // namespace

std::unique_ptr<Hdf5Table> make_row_table(Hdf5Format format, Hdf5Dataset events, SensorSize size,
                                          bool wraps, const ColumnOrder& order) {
  return std::make_unique<RowTable>(format, std::move(events), size, wraps, order);
}

}  // namespace eventcamera
