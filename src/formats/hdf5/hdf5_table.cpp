// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_table.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <utility>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_dataset.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"
#include "src/formats/unwrapped_clock.hpp"

namespace eventcamera {

namespace {

/// Column numbers of t, x, y and p.
using ColumnOrder = std::array<std::size_t, event_columns>;

struct Attribute {
  Attribute(hid_t object, const char* name, hssize_t numbers = 1) {
    if (H5Aexists(object, name) <= 0) return;
    attribute = {H5Aopen(object, name, H5P_DEFAULT), H5Aclose};
    const Hdf5Handle space(H5Aget_space(attribute.get()), H5Sclose);
    if (H5Sget_simple_extent_npoints(space.get()) == numbers)
      type = {H5Aget_type(attribute.get()), H5Tclose};
  }

  Hdf5Handle attribute, type;
};

/// Reads a string attribute of a group or dataset.
std::optional<std::string> read_text_attribute(hid_t object, const char* name) {
  const Attribute found(object, name);
  if (!found.type || H5Tget_class(found.type.get()) != H5T_STRING) return std::nullopt;
  if (H5Tis_variable_str(found.type.get()) > 0) {
    char* text = nullptr;
    if (H5Aread(found.attribute.get(), found.type.get(), static_cast<void*>(&text)) < 0 ||
        text == nullptr)
      return std::nullopt;
    std::string copy(text);
    H5free_memory(text);
    return copy;
  }
  constexpr std::size_t max_text = 4096;
  const auto bytes = H5Tget_size(found.type.get());
  if (bytes == 0 || bytes > max_text) return std::nullopt;
  std::string text(bytes, '\0');
  if (H5Aread(found.attribute.get(), found.type.get(), text.data()) < 0) return std::nullopt;
  text.resize(text.find_last_not_of(std::string_view("\0 ", 2)) + 1);
  return text;
}

/// Reads an integer attribute, of `count` integers, of a group or dataset.
template <std::size_t count>
std::optional<std::array<std::int64_t, count>> read_integers(hid_t object, const char* name) {
  const Attribute found(object, name, count);
  if (!found.type || H5Tget_class(found.type.get()) != H5T_INTEGER) return std::nullopt;
  std::array<std::int64_t, count> numbers = {};
  if (H5Aread(found.attribute.get(), H5T_NATIVE_INT64, numbers.data()) < 0) return std::nullopt;
  return numbers;
}

/// Sensor size in the attributes of a group or file; 0x0 if there is none.
SensorSize size_of_attributes(hid_t object) {
  const auto width = read_integers<1>(object, "width");
  const auto height = read_integers<1>(object, "height");
  if (width && height && is_side(width->front()) && is_side(height->front()))
    return {static_cast<int>(width->front()), static_cast<int>(height->front())};
  // Some tools state the height first; sensors are wider than high.
  for (const char* const name :
       {"sensor_resolution", "sensor_size", "sensor_shape", "resolution"}) {
    const auto pair = read_integers<2>(object, name);
    if (pair && is_side((*pair)[0]) && is_side((*pair)[1]))
      return {static_cast<int>(std::max((*pair)[0], (*pair)[1])),
              static_cast<int>(std::min((*pair)[0], (*pair)[1]))};
  }
  return {};
}

/// Names of the datasets or members with t, x, y and p.
struct NamedColumns {
  std::array<std::string, event_columns> names;
  std::optional<TimeUnit> unit;

  bool are_complete() const {
    return std::ranges::none_of(names, [](const auto& name) { return name.empty(); });
  }

  void add(const std::string& name) {
    const auto found = column_named(name);
    if (!found || found->column > EventColumn::p) return;
    auto& known = names[static_cast<std::size_t>(found->column)];
    if (!known.empty()) return;
    known = name;
    if (found->column == EventColumn::t) unit = found->unit;
  }
};

class EcfTable final : public Hdf5Table {
 public:
  EcfTable(Hdf5Dataset events, SensorSize size)
      : events_(std::move(events)), chunk_rows_(events_.chunk_rows()) {
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
      validator.append(event.t, event.x, event.y(), event.polarity() == Polarity::on, out,
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

/// Events as plain numbers: rows of one dataset, or a dataset for each column.
class NumberTable final : public Hdf5Table {
 public:
  /// A dataset with the numbers of each event in a row: v2e, MVSEC, Metavision without compression,
  /// and others. Detects the order and the unit unless they are known. Throws UnsupportedFormat.
  NumberTable(Hdf5Dataset events, const std::string& path, SensorSize size,
              std::optional<ColumnOrder> order, std::optional<TimeUnit> unit) {
    const bool is_unsigned_32 = events.rank() == 2 && events.is_unsigned_32();
    const bool are_integers = events.is_integers();
    datasets_.push_back(std::move(events));
    open_datasets();
    size_ = size;
    const auto sample = read_sample();
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
      places_[static_cast<std::size_t>(*columns[i])] = {0, i};
    step_ = event_columns;
    if (!unit && is_unsigned_32) unit = TimeUnit::microseconds;
    set_unit(detect(sample, columns, unit, !are_integers, path), is_unsigned_32);
  }

  /// Datasets of a group that hold the columns t, x, y and p: the DSEC layout, and others without
  /// its index. `group` is empty, or ends with a slash. Throws UnsupportedFormat.
  NumberTable(hid_t file, const std::string& group, const NamedColumns& names,
              std::optional<TimeUnit> unit) {
    for (const auto& name : names.names) {
      const auto& column = datasets_.emplace_back(file, group + name);
      if (column.rank() != 1 || !column.is_numbers())
        throw UnsupportedFormat("HDF5 group /" + group + " must hold columns of numbers");
    }
    open_datasets();
    for (std::size_t i = 0; i < all_columns; ++i) places_[i] = {i, 0};
    read_offset(file);
    open_index(file);
    const bool is_unsigned_32 = times().is_unsigned_32();
    // Nanoseconds of 32 bits would wrap after four seconds.
    if (!unit && (index_ || (is_unsigned_32 && !names.unit))) unit = TimeUnit::microseconds;
    set_unit(detect(read_sample(), *columns_of("txyp"), unit ? unit : names.unit,
                    !times().is_integers(), group + names.names[0]),
             is_unsigned_32);
    open_labels(file, group);
    size_ = size_of_attributes(file);
    if (size_ == SensorSize{} && !group.empty()) {
      const Hdf5Handle events(H5Gopen2(file, group.c_str(), H5P_DEFAULT), H5Gclose);
      size_ = size_of_attributes(events.get());
    }
  }

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
    const auto column = [&](EventColumn of) {
      const auto [dataset, number] = places_[static_cast<std::size_t>(of)];
      return numbers_[dataset].data() + number;
    };
    const auto* const ts = column(EventColumn::t);
    const auto* const xs = column(EventColumn::x);
    const auto* const ys = column(EventColumn::y);
    const auto* const ps = column(EventColumn::p);
    const auto* const causes = has_labels_ ? column(EventColumn::cause) : nullptr;
    const auto* const classes = has_labels_ ? column(EventColumn::object_class) : nullptr;
    if (wraps_ && row != next_row_) clock_.restore(unwrapped(row, *ts));
    next_row_ = end;
    for (std::size_t i = 0; i < (end - row) * step_; i += step_) {
      Microseconds t = wraps_ ? clock_.follow(static_cast<std::uint32_t>(ts[i])) : ts[i];
      if (__builtin_add_overflow(t, offset_, &t)) {
        note(corruption, times(), row, "timestamp out of range");
        continue;
      }
      const auto on = polarities_.is_on(ps[i]);
      if (!on) {
        note(corruption, times(), row, "polarity other than 0, 1 and -1");
        continue;
      }
      const auto label = has_labels_ ? label_from(causes[i], classes[i]) : Label{};
      validator.append(t, xs[i], ys[i], *on, label, out, corruption);
    }
    return end;
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

 private:
  using Clock = UnwrappedClock<32>;

  /// Dataset of a column, and the column's number in its rows.
  struct Place {
    std::size_t dataset;
    std::size_t number;
  };

  /// The clock at a row.
  struct Sample {
    std::uint64_t row;
    Clock clock;
  };

  void open_datasets() {
    rows_ = datasets_.front().rows();
    for (auto& dataset : datasets_) {
      dataset.require_filters();
      rows_ = std::min(rows_, dataset.rows());
      claimed_rows_ = std::max(claimed_rows_, dataset.claimed_rows());
    }
  }

  Hdf5Dataset& times() { return datasets_.front(); }

  /// Reads `numbers_`. Returns the dataset that could not be read, or nullptr.
  const Hdf5Dataset* read_numbers(std::uint64_t row, std::uint64_t count) {
    numbers_.resize(datasets_.size());
    for (std::size_t i = 0; i < datasets_.size(); ++i)
      if (!datasets_[i].read(row, count, numbers_[i])) return &datasets_[i];
    return nullptr;
  }

  /// Returns the first rows, up to the end of a chunk; none if they are corrupt.
  TableSample read_sample() {
    TableSample sample;
    std::vector<TableSample::Row> rows;
    const auto count = std::min<std::uint64_t>({rows_, TableSample::max_binary_rows, chunk_end(0)});
    for (auto& dataset : datasets_)
      if (!dataset.sample(count, rows)) return sample;
    for (auto& row : rows) sample.add(std::move(row));
    return sample;
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

  void set_unit(TimeUnit unit, bool is_unsigned_32) {
    times().set_unit(places_[0].number, unit);
    wraps_ = is_unsigned_32 && unit == TimeUnit::microseconds;
  }

  /// First row after the chunk of this row, in any dataset.
  std::uint64_t chunk_end(std::uint64_t row) const {
    auto end = rows_;
    for (const auto& dataset : datasets_) end = std::min(end, dataset.chunk_end(row));
    return end;
  }

  /// Unwraps the time of a row, `number`; without the offset.
  Microseconds unwrapped(std::uint64_t row, std::int64_t number) {
    if (!wraps_) return number;
    if (!index_) {
      if (samples_.empty()) read_samples();
      auto clock = std::prev(std::ranges::upper_bound(samples_, row, {}, &Sample::row))->clock;
      return clock.follow(static_cast<std::uint32_t>(number));
    }
    constexpr auto lap = static_cast<Microseconds>(Clock::range);
    if (index_->rows() <= Clock::range / 1000) return number;
    const auto milliseconds = first_row(index_->rows(), [&](std::uint64_t at) {
      const auto indexed_row = indexed(at);
      return indexed_row && *indexed_row <= row;
    });
    if (milliseconds == 0 || milliseconds > INT64_MAX / 1000) return number;
    const auto about = static_cast<Microseconds>((milliseconds - 1) * 1000);
    return number + std::max<Microseconds>((about - number + lap / 2) / lap, 0) * lap;
  }

  /// Time of a row as stored in the file.
  std::optional<std::int64_t> time_number(std::uint64_t row) {
    std::vector<std::int64_t> numbers;
    if (!times().read(row, 1, numbers)) return std::nullopt;
    return numbers[places_[0].number];
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

  /// Opens the columns cause and class, if both are there and have a number for each event.
  void open_labels(hid_t file, const std::string& group) {
    std::vector<Hdf5Dataset> labels;
    for (const char* const name : {"cause", "class"}) {
      if (!Hdf5Dataset::exists(file, group + name, H5O_TYPE_DATASET)) return;
      auto& column = labels.emplace_back(file, group + name);
      if (column.rank() != 1 || !column.is_integers() || column.rows() < rows_) return;
      column.require_filters();
    }
    std::ranges::move(labels, std::back_inserter(datasets_));
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

  std::vector<Hdf5Dataset> datasets_;               ///< the first has the times
  std::array<Place, all_columns> places_ = {};      ///< by EventColumn
  std::size_t step_ = 1;                            ///< numbers in a row of a dataset
  std::vector<std::vector<std::int64_t>> numbers_;  ///< read last, of each dataset
  std::optional<Hdf5Dataset> index_;                ///< first event at or after each millisecond
  PolarityCode polarities_;
  Microseconds offset_ = 0;
  bool wraps_ = false;           ///< times have 32 bits and wrap after 71 minutes
  std::vector<Sample> samples_;  ///< read on first use
  std::uint64_t next_row_ = 0;
  Clock clock_;  ///< before next_row_
};

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

/// Size of the frames that v2e stores beside its events; 0x0 if there are none.
SensorSize size_of_frames(hid_t file) {
  if (!Hdf5Dataset::exists(file, "frame", H5O_TYPE_DATASET)) return {};
  const Hdf5Handle frame(H5Dopen2(file, "frame", H5P_DEFAULT), H5Dclose);
  const Hdf5Handle space(H5Dget_space(frame.get()), H5Sclose);
  hsize_t extent[3] = {};  // frames, rows, columns
  if (H5Sget_simple_extent_ndims(space.get()) != 3 ||
      H5Sget_simple_extent_dims(space.get(), extent, nullptr) != 3 ||
      !is_side(static_cast<std::int64_t>(extent[1])) ||
      !is_side(static_cast<std::int64_t>(extent[2])))
    return {};
  return {static_cast<int>(extent[2]), static_cast<int>(extent[1])};
}

std::unique_ptr<Hdf5Table> open_metavision(hid_t file) {
  const std::string path = "CD/events";
  Hdf5Dataset events(file, path);
  if (events.rank() != 1) throw UnsupportedFormat("HDF5 dataset /CD/events must hold rows");
  const std::string members[] = {"t", "x", "y", "p"};
  events.choose(members);
  const auto size = read_geometry(read_text_attribute(file, "geometry").value_or(""));
  if (events.has_only_filter(ecf_filter))
    return std::make_unique<EcfTable>(std::move(events), size);
  return std::make_unique<NumberTable>(std::move(events), path, size, ColumnOrder{0, 1, 2, 3},
                                       TimeUnit::microseconds);
}

NamedColumns named_columns(const Hdf5Dataset& events) {
  NamedColumns columns;
  for (const auto& member : events.members()) columns.add(member);
  return columns;
}

bool is_row_of_numbers(const Hdf5Dataset& events) {
  return events.rank() == 2 && events.columns() == event_columns && events.is_numbers();
}

/// Order of the columns that the user has set.
std::optional<ColumnOrder> order_of(const Columns& columns) {
  if (columns.empty()) return std::nullopt;
  if (columns.size() != event_columns)
    throw UnsupportedFormat("column-order must have four letters: HDF5 rows have four numbers");
  ColumnOrder order = {};
  for (std::size_t i = 0; i < event_columns; ++i) order[static_cast<std::size_t>(*columns[i])] = i;
  return order;
}

/// Creates the table of a dataset whose rows are events: records with members t, x, y and p, or
/// rows of four numbers. Throws UnsupportedFormat.
std::unique_ptr<Hdf5Table> open_rows(hid_t file, const std::string& path,
                                     const TableSettings& settings) {
  Hdf5Dataset events(file, path);
  auto size = size_of_attributes(file);
  if (size == SensorSize{}) size = size_of_frames(file);
  if (!events.members().empty()) {
    const auto columns = named_columns(events);
    if (!columns.are_complete())
      throw UnsupportedFormat("HDF5 dataset /" + path + " has no members t, x, y and p");
    events.choose(columns.names);
    return std::make_unique<NumberTable>(std::move(events), path, size, ColumnOrder{0, 1, 2, 3},
                                         settings.unit ? settings.unit : columns.unit);
  }
  if (!is_row_of_numbers(events))
    throw UnsupportedFormat("HDF5 dataset /" + path +
                            " must hold rows of four numbers t, x, y and p");
  // MVSEC (A. Z. Zhu et al., "The Multi Vehicle Stereo Event Camera Dataset", 2018) has rows of x,
  // y, t and p, of a DAVIS 346B.
  const bool is_mvsec = path.starts_with("davis/");
  // Floats of 32 bits would be too coarse for its dates.
  if (is_mvsec && !events.is_doubles())
    throw UnsupportedFormat("HDF5 dataset /" + path +
                            " must hold rows of four fractional numbers x, y, t and p");
  if (size == SensorSize{} && is_mvsec) size = {346, 260};
  auto order = order_of(settings.columns);
  if (!order && is_mvsec) order = ColumnOrder{2, 0, 1, 3};
  if (!order && events.is_integers()) order = ColumnOrder{0, 1, 2, 3};  // v2e
  auto unit = settings.unit;
  if (!unit && is_mvsec) unit = TimeUnit::seconds;
  return std::make_unique<NumberTable>(std::move(events), path, size, order, unit);
}

/// Searches a group of a file for events.
class EventSearch {
 public:
  /// `group` is empty for the root, or ends with a slash.
  EventSearch(hid_t file, const std::string& group, const TableSettings& settings)
      : file_(file), settings_(settings) {
    for (std::vector<std::string> groups = {group}; !groups.empty();) {
      std::vector<std::string> next;
      for (const auto& candidate : groups) look_into(candidate, next);
      groups = ++depth_ < max_depth ? std::move(next) : std::vector<std::string>();
    }
  }

  /// Returns the events of the first group that has some, of those closest to `group`. Null if
  /// there are none.
  std::unique_ptr<Hdf5Table> table() { return std::move(table_); }

  /// Error of the first dataset with events in its name; empty if there is none.
  const std::string& cause() const { return cause_; }

  /// Paths of the first events, and of the others.
  const std::string& path() const { return path_; }
  const std::string& others() const { return others_; }

 private:
  static constexpr int max_depth = 6;
  static constexpr std::size_t max_links = 4096;
  static constexpr std::size_t max_others = 8;

  /// Looks for events in a group, and appends its groups to `next`.
  void look_into(const std::string& group, std::vector<std::string>& next) {
    NamedColumns columns;
    std::vector<std::string> rows;
    for (const auto& name : names_in(group)) {
      const auto path = group + name;
      if (Hdf5Dataset::exists(file_, path, H5O_TYPE_GROUP))
        next.push_back(path + "/");
      else if (name.find("event") != std::string::npos &&
               Hdf5Dataset::exists(file_, path, H5O_TYPE_DATASET) && !column_named(name))
        rows.push_back(path);
      else if (column_named(name) && Hdf5Dataset::exists(file_, path, H5O_TYPE_DATASET))
        columns.add(name);
    }
    // Names are sorted, so a left camera comes before a right one.
    if (columns.are_complete()) {
      if (!table_) table_ = std::make_unique<NumberTable>(file_, group, columns, settings_.unit);
      add_path(group.substr(0, group.size() - (group.empty() ? 0 : 1)));
      return;
    }
    for (const auto& path : rows) {
      try {
        if (!table_)
          table_ = open_rows(file_, path, settings_);
        else if (const Hdf5Dataset events(file_, path);
                 !is_row_of_numbers(events) && !named_columns(events).are_complete())
          continue;
        add_path(path);
      } catch (const UnsupportedFormat& error) {
        if (cause_.empty()) cause_ = error.what();
      }
    }
  }

  void add_path(const std::string& path) {
    if (count_++ == 0)
      path_ = "/" + path;
    else if (count_ <= max_others + 1)
      others_ += (others_.empty() ? "/" : ", /") + path;
    else if (count_ == max_others + 2)
      others_ += ", …";
  }

  std::vector<std::string> names_in(const std::string& group) {
    constexpr std::size_t max_name = 255;
    std::vector<std::string> names;
    const auto path = group.empty() ? std::string("/") : group;
    H5G_info_t info;
    if (H5Gget_info_by_name(file_, path.c_str(), &info, H5P_DEFAULT) < 0) return names;
    for (hsize_t i = 0; i < info.nlinks && links_ < max_links; ++i, ++links_) {
      char name[max_name + 1];
      const auto length = H5Lget_name_by_idx(file_, path.c_str(), H5_INDEX_NAME, H5_ITER_INC, i,
                                             name, sizeof name, H5P_DEFAULT);
      if (length > 0 && static_cast<std::size_t>(length) <= max_name) names.emplace_back(name);
    }
    return names;
  }

  hid_t file_;
  const TableSettings& settings_;
  std::unique_ptr<Hdf5Table> table_;
  std::string path_, others_;
  std::size_t count_ = 0;  ///< events found
  int depth_ = 0;
  std::size_t links_ = 0;
  std::string cause_;
};

/// Opens the events at a path that the user has set.
std::unique_ptr<Hdf5Table> open_path(hid_t file, const std::string& path,
                                     const TableSettings& settings) {
  if (Hdf5Dataset::exists(file, path, H5O_TYPE_DATASET)) return open_rows(file, path, settings);
  if (Hdf5Dataset::exists(file, path, H5O_TYPE_GROUP)) {
    EventSearch search(file, path + "/", settings);
    if (auto table = search.table()) return table;
  }
  const EventSearch everywhere(file, "", settings);
  const auto& others = everywhere.others();
  throw UnsupportedFormat(
      "the HDF5 file has no events at events-path /" + path +
      (everywhere.path().empty() ? "" : "; it has some at " + everywhere.path()) +
      (others.empty() ? "" : ", ") + others);
}

}  // namespace

std::unique_ptr<Hdf5Table> Hdf5Table::open(hid_t file, const Hdf5Selection& selection) {
  const auto begin = std::min(selection.path.find_first_not_of('/'), selection.path.size());
  const auto path = selection.path.substr(begin, selection.path.find_last_not_of('/') + 1 - begin);
  const bool is_metavision = path.empty() || path == "CD" || path == "CD/events";
  if (is_metavision && Hdf5Dataset::exists(file, "CD/events", H5O_TYPE_DATASET)) {
    auto table = open_metavision(file);
    table->is_metavision_ = true;
    return table;
  }
  if (!path.empty()) return open_path(file, path, selection.table);
  EventSearch search(file, "", selection.table);
  auto table = search.table();
  if (table) {
    table->others_ = search.others();
    return table;
  }
  if (!search.cause().empty()) throw UnsupportedFormat(search.cause());
  throw UnsupportedFormat(
      "no events in the HDF5 file: it needs four datasets of a group that are named t, x, y and p "
      "(or xs, timestamp, polarity and the like), or one named events, with these members or "
      "columns");
}

}  // namespace eventcamera
