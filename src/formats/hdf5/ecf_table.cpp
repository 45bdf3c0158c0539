// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/ecf_table.hpp"

#include <algorithm>
#include <utility>

#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_rows.hpp"
#include "src/formats/unsupported_format.hpp"

namespace eventcamera {

namespace {

class EcfTable final : public Hdf5Table {
 public:
  EcfTable(Hdf5Dataset events, SensorSize size)
      : Hdf5Table(Hdf5Format::metavision),
        events_(std::move(events)),
        chunk_rows_(events_.chunk_rows()) {
    if (chunk_rows_ == 0 || chunk_rows_ > ecf_max_events)
      throw UnsupportedFormat("HDF5 dataset /CD/events has chunks too large for ECF");
    size_ = size;
    rows_ = events_.rows();
    claimed_rows_ = events_.claimed_rows();
  }

  std::uint64_t read(std::uint64_t row, RowValidator& validator, std::vector<AbsoluteEvent>& out,
                     Corruption& corruption) override {
    const auto chunk = row / chunk_rows_;
    const auto begin = chunk * chunk_rows_;
    const auto end = std::min(rows_, begin + chunk_rows_);
    if (!read_chunk(chunk)) {
      note(corruption, events_, row, "corrupt ECF chunk");
      return end;
    }
    if (decoded_.size() < end - begin)
      note(corruption, events_, row, "ECF chunk with too few events");
    for (auto i = row - begin; i < std::min<std::uint64_t>(decoded_.size(), end - begin); ++i) {
      const auto& event = decoded_[i];
      validator.take(event.t, event.x, event.y(), event.polarity() == Polarity::on, out,
                     corruption);
    }
    return end;
  }

  std::uint64_t row_before(Microseconds t) override {
    // Last chunk that begins before t.
    const auto first = first_row((rows_ + chunk_rows_ - 1) / chunk_rows_, [&](std::uint64_t chunk) {
      const auto time = read_stored(chunk) ? ecf_first_time(stored_) : std::nullopt;
      return time && *time < t;
    });
    return first == 0 ? 0 : (first - 1) * chunk_rows_;
  }

  std::optional<Microseconds> time_at(std::uint64_t row) override {
    const auto at = row % chunk_rows_;
    if (row >= rows_ || !read_chunk(row / chunk_rows_) || at >= decoded_.size())
      return std::nullopt;
    return decoded_[at].t;
  }

 private:
  bool read_stored(std::uint64_t chunk) {
    return events_.read_chunk(chunk * chunk_rows_, ecf_max_bytes(chunk_rows_), stored_);
  }

  bool read_chunk(std::uint64_t chunk) {
    decoded_.clear();
    return read_stored(chunk) && decode_ecf(stored_, decoded_);
  }

  Hdf5Dataset events_;
  std::uint64_t chunk_rows_;
  std::vector<std::uint8_t> stored_;
  std::vector<AbsoluteEvent> decoded_;
};

}  // namespace

std::unique_ptr<Hdf5Table> make_ecf_table(Hdf5Dataset events, SensorSize size) {
  return std::make_unique<EcfTable>(std::move(events), size);
}

}  // namespace eventcamera
