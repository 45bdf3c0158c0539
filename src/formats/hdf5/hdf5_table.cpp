// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_table.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <string>

#include "src/core/max_side.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"
#include "src/formats/unwrapped_clock.hpp"

namespace eventcamera {

namespace {

constexpr std::uint64_t block_rows = 16384;
constexpr std::size_t columns = 4;  // t, x, y and p

std::uint64_t block_end(std::uint64_t row, std::uint64_t rows) {
  return std::min(rows, (row / block_rows + 1) * block_rows);
}

/// Returns the first row for which `is_before(row)`, which must be sorted, is false.
template <class IsBefore>
std::uint64_t first_row(std::uint64_t rows, const IsBefore& is_before) {
  std::uint64_t first = 0;
  while (rows > 0) {
    const auto half = rows / 2;
    const bool before = is_before(first + half);
    if (before) first += half + 1;
    rows = before ? rows - half - 1 : half;
  }
  return first;
}

/// Parses a size such as 1280x720.
SensorSize read_geometry(std::string_view text) {
  SensorSize size;
  const char* const end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, size.width);
  if (width.ec != std::errc() || width.ptr == end || *width.ptr != 'x') return {};
  const auto height = std::from_chars(width.ptr + 1, end, size.height);
  if (height.ec != std::errc() || !is_side(size.width) || !is_side(size.height)) return {};
  return size;
}

/// Looks up the position for the first corruption only, because that is slow and only the first is
/// reported.
void note(Corruption& corruption, const Hdf5Dataset& dataset, std::uint64_t row, const char* what) {
  corruption.note(corruption.places == 0 ? dataset.position(row) : 0, what);
}

SensorSize size_of_attributes(hid_t object) {
  const auto width = read_number_attribute(object, "width");
  const auto height = read_number_attribute(object, "height");
  if (!width || !height || !is_side(*width) || !is_side(*height)) return {};
  return {static_cast<int>(*width), static_cast<int>(*height)};
}

/// Base of layouts with events as plain numbers.
class NumberTable : public Hdf5Table {
 public:
  using Hdf5Table::Hdf5Table;

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
      const auto label = has_labels_ ? label_from(cause_[i], object_class_[i]) : Label{};
      validator.take(t, x_[i], y_[i], p_[i] > 0, label, out, corruption);
    }
    return end;
  }

  std::uint64_t row_before(Microseconds t) override {
    // An unreadable row counts as late, so that no event is skipped.
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
  using Clock = UnwrappedClock<32>;

  virtual Hdf5Dataset& t_dataset() = 0;
  virtual std::size_t t_column() const { return 0; }  ///< in the rows of t_dataset()

  /// Reads t_, x_, y_ and p_, and the labels, if there are any. Returns the dataset that could not
  /// be read, or nullptr.
  virtual const Hdf5Dataset* read_numbers(std::uint64_t row, std::uint64_t count) = 0;

  /// First row after the chunk of this row.
  virtual std::uint64_t chunk_end(std::uint64_t row) const = 0;

  /// Time of the row with this number, before the offset is added.
  virtual Microseconds unwrapped(std::uint64_t row, std::int64_t number) {
    if (!wraps_) return number;
    if (samples_.empty()) take_samples();
    auto clock = std::prev(std::ranges::upper_bound(samples_, row, {}, &Sample::row))->clock;
    return clock.follow(static_cast<std::uint32_t>(number));
  }

  Microseconds offset_ = 0;
  bool wraps_ = false;  ///< times have 32 bits and wrap after 71 minutes
  std::vector<std::int64_t> t_, x_, y_, p_, cause_, object_class_;

 private:
  /// Time of a row as the file has it.
  std::optional<std::int64_t> time_number(std::uint64_t row) {
    std::vector<std::int64_t> numbers;
    if (!t_dataset().read(row, 1, numbers)) return std::nullopt;
    return numbers[t_column()];
  }

  /// Follows the clock through rows that must be less than about half an hour apart.
  void take_samples() {
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

  /// The clock at a row.
  struct Sample {
    std::uint64_t row;
    Clock clock;
  };

  std::vector<Sample> samples_;  ///< once they are needed
  std::uint64_t next_row_ = 0;
  Clock clock_;  ///< before next_row_
};

/// Columns in a group of any name: the DSEC layout, and others without its index.
class DsecTable final : public NumberTable {
 public:
  DsecTable(hid_t file, const std::string& group) : NumberTable(Hdf5Format::dsec) {
    for (const char* const name : {"/t", "/x", "/y", "/p"})
      columns_.emplace_back(file, group + name);
    rows_ = columns_[0].rows();
    for (auto& column : columns_) {
      if (column.rank() != 1 || !column.is_integers())
        throw UnsupportedFormat("HDF5 group /" + group + " must hold columns of integers");
      column.require_filters();
      rows_ = std::min(rows_, column.rows());
      claimed_rows_ = std::max(claimed_rows_, column.claimed_rows());
    }
    open_labels(file, group);
    wraps_ = columns_[0].is_unsigned_32();
    if (Hdf5Dataset::exists(file, "t_offset", H5O_TYPE_DATASET)) {
      Hdf5Dataset offset(file, "t_offset");
      std::vector<std::int64_t> number;
      constexpr Microseconds most = INT64_MAX / 2;
      if (!offset.is_integers() || offset.rows() != 1 || offset.columns() != 1 ||
          !offset.read(0, 1, number) || number[0] > most || number[0] < -most)
        throw UnsupportedFormat("HDF5 dataset /t_offset is not a time");
      offset_ = number[0];
    }
    if (Hdf5Dataset::exists(file, "ms_to_idx", H5O_TYPE_DATASET)) {
      Hdf5Dataset index(file, "ms_to_idx");
      if (index.rank() == 1 && index.is_integers()) {
        index.require_filters();
        index_ = std::move(index);
      }
    }
    size_ = size_of_attributes(file);
    if (size_ == SensorSize{}) {
      const Hdf5Handle events(H5Gopen2(file, group.c_str(), H5P_DEFAULT), H5Gclose);
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
  /// Opens the columns cause and class, if both are there and have a number for each event.
  void open_labels(hid_t file, const std::string& group) {
    std::vector<Hdf5Dataset> labels;
    for (const char* const name : {"/cause", "/class"}) {
      if (!Hdf5Dataset::exists(file, group + name, H5O_TYPE_DATASET)) return;
      auto& column = labels.emplace_back(file, group + name);
      if (column.rank() != 1 || !column.is_integers() || column.rows() < rows_) return;
      column.require_filters();
    }
    std::ranges::move(labels, std::back_inserter(columns_));
    has_labels_ = true;
  }

  std::optional<std::uint64_t> indexed(std::uint64_t milliseconds) {
    std::vector<std::int64_t> row;
    if (milliseconds >= index_->rows() || !index_->read(milliseconds, 1, row) || row[0] < 0)
      return std::nullopt;
    return static_cast<std::uint64_t>(row[0]);
  }

  std::vector<Hdf5Dataset> columns_;  ///< t, x, y and p, and those of labels
  std::optional<Hdf5Dataset> index_;  ///< first event at or after each millisecond
};

/// Columns of rows, by their place: t, x, y and p.
using ColumnOrder = std::array<std::size_t, columns>;

/// The v2e layout, the uncompressed Metavision layout, and that of MVSEC.
class RowTable final : public NumberTable {
 public:
  /// Times have 32 bits if `wraps`.
  RowTable(Hdf5Format format, Hdf5Dataset events, SensorSize size, bool wraps,
           ColumnOrder order = {0, 1, 2, 3})
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
    for (std::size_t column = 0; column < columns; ++column) {
      separate[column]->resize(count);
      for (std::size_t i = 0; i < count; ++i)
        (*separate[column])[i] = numbers_[i * columns + order_[column]];
    }
    return nullptr;
  }

  std::uint64_t chunk_end(std::uint64_t row) const override { return events_.chunk_end(row); }

 private:
  Hdf5Dataset events_;
  ColumnOrder order_;
  std::vector<std::int64_t> numbers_;
};

/// The Metavision layout with ECF compression.
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

std::unique_ptr<Hdf5Table> open_v2e(hid_t file) {
  Hdf5Dataset events(file, "events");
  if (events.rank() != 2 || events.columns() != columns || !events.is_integers())
    throw UnsupportedFormat("HDF5 dataset /events must hold rows of four integers t, x, y and p");
  SensorSize size;
  if (Hdf5Dataset::exists(file, "frame", H5O_TYPE_DATASET)) {
    const Hdf5Handle frame(H5Dopen2(file, "frame", H5P_DEFAULT), H5Dclose);
    const Hdf5Handle space(H5Dget_space(frame.get()), H5Sclose);
    hsize_t extent[3] = {};  // frames, rows, columns
    if (H5Sget_simple_extent_ndims(space.get()) == 3 &&
        H5Sget_simple_extent_dims(space.get(), extent, nullptr) == 3 &&
        is_side(static_cast<std::int64_t>(extent[1])) &&
        is_side(static_cast<std::int64_t>(extent[2])))
      size = {static_cast<int>(extent[2]), static_cast<int>(extent[1])};
  }
  const bool wraps = events.is_unsigned_32();
  return std::make_unique<RowTable>(Hdf5Format::v2e, std::move(events), size, wraps);
}

/// MVSEC (A. Z. Zhu et al., "The Multi Vehicle Stereo Event Camera Dataset", 2018): rows of
/// fractional numbers x, y, t in seconds and p, 1 or -1, of a DAVIS 346B.
std::unique_ptr<Hdf5Table> open_mvsec(hid_t file) {
  constexpr std::size_t time_column = 2;
  Hdf5Dataset events(file, "davis/left/events");
  if (events.rank() != 2 || events.columns() != columns || !events.take_fractions(time_column))
    throw UnsupportedFormat(
        "HDF5 dataset /davis/left/events must hold rows of four fractional numbers x, y, t and p");
  return std::make_unique<RowTable>(Hdf5Format::mvsec, std::move(events), SensorSize{346, 260},
                                    false, ColumnOrder{time_column, 0, 1, 3});
}

std::unique_ptr<Hdf5Table> open_metavision(hid_t file) {
  Hdf5Dataset events(file, "CD/events");
  if (events.rank() != 1) throw UnsupportedFormat("HDF5 dataset /CD/events must hold rows");
  constexpr const char* members[] = {"t", "x", "y", "p"};
  events.choose(members);
  const auto size = read_geometry(read_text_attribute(file, "geometry").value_or(""));
  if (events.has_only_filter(ecf_filter))
    return std::make_unique<EcfTable>(std::move(events), size);
  return std::make_unique<RowTable>(Hdf5Format::metavision, std::move(events), size, false);
}

}  // namespace

std::unique_ptr<Hdf5Table> Hdf5Table::open(hid_t file) {
  if (Hdf5Dataset::exists(file, "CD/events", H5O_TYPE_DATASET)) return open_metavision(file);
  for (const char* const group : {"events", "raw_events"})
    if (Hdf5Dataset::exists(file, std::string(group) + "/t", H5O_TYPE_DATASET))
      return std::make_unique<DsecTable>(file, group);
  if (Hdf5Dataset::exists(file, "davis/left/events", H5O_TYPE_DATASET)) return open_mvsec(file);
  if (Hdf5Dataset::exists(file, "events", H5O_TYPE_DATASET)) return open_v2e(file);
  throw UnsupportedFormat(
      "none of the known HDF5 layouts: /events/t (DSEC, TUM-VIE), /raw_events/t, /events (v2e), "
      "/CD/events (Metavision), /davis/left/events (MVSEC)");
}

Hdf5Triggers::Hdf5Triggers(hid_t file) : dataset_(file, "EXT_TRIGGER/events") {
  if (dataset_.rank() != 1)
    throw UnsupportedFormat("HDF5 dataset /EXT_TRIGGER/events must hold rows");
  constexpr const char* members[] = {"t", "p", "id"};
  dataset_.choose(members);
  dataset_.require_filters();
}

std::unique_ptr<Hdf5Triggers> Hdf5Triggers::open(hid_t file) {
  if (!Hdf5Dataset::exists(file, "EXT_TRIGGER/events", H5O_TYPE_DATASET)) return nullptr;
  return std::unique_ptr<Hdf5Triggers>(new Hdf5Triggers(file));
}

bool Hdf5Triggers::read(std::size_t count, std::vector<Trigger>& out, Corruption& corruption) {
  if (row_ >= dataset_.rows() || count == 0) return false;
  const auto end = std::min<std::uint64_t>(block_end(row_, dataset_.rows()), row_ + count);
  if (dataset_.read(row_, end - row_, numbers_)) {
    for (std::size_t i = 0; i < numbers_.size(); i += 3)
      out.push_back(
          {numbers_[i], static_cast<std::uint16_t>(numbers_[i + 2]), numbers_[i + 1] > 0});
  } else {
    note(corruption, dataset_, row_, "unreadable part of an HDF5 dataset");
  }
  row_ = end;
  return true;
}

void Hdf5Triggers::seek(Microseconds t) {
  row_ = first_row(dataset_.rows(), [&](std::uint64_t row) {
    return dataset_.read(row, 1, numbers_) && numbers_[0] < t;
  });
}

}  // namespace eventcamera
