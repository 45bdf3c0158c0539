// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_table.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"

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
  return make_row_table(Hdf5Format::metavision, std::move(events), path, size,
                        ColumnOrder{0, 1, 2, 3}, TimeUnit::microseconds);
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
    return make_row_table(Hdf5Format::v2e, std::move(events), path, size, ColumnOrder{0, 1, 2, 3},
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
  return make_row_table(is_mvsec ? Hdf5Format::mvsec : Hdf5Format::v2e, std::move(events), path,
                        size, order, unit);
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
      if (!table_)
        table_ = make_dsec_table(file_, {group, columns.names, columns.unit, settings_.unit});
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

SensorSize size_of_attributes(hid_t object) {
  const auto width = read_number_attribute(object, "width");
  const auto height = read_number_attribute(object, "height");
  if (width && height && is_side(*width) && is_side(*height))
    return {static_cast<int>(*width), static_cast<int>(*height)};
  // Some tools state the height first; sensors are wider than high.
  for (const char* const name :
       {"sensor_resolution", "sensor_size", "sensor_shape", "resolution"}) {
    const auto pair = read_pair_attribute(object, name);
    if (pair && is_side((*pair)[0]) && is_side((*pair)[1]))
      return {static_cast<int>(std::max((*pair)[0], (*pair)[1])),
              static_cast<int>(std::min((*pair)[0], (*pair)[1]))};
  }
  return {};
}

std::unique_ptr<Hdf5Table> Hdf5Table::open(hid_t file, const Hdf5Selection& selection) {
  const auto begin = std::min(selection.path.find_first_not_of('/'), selection.path.size());
  const auto path = selection.path.substr(begin, selection.path.find_last_not_of('/') + 1 - begin);
  const bool is_metavision = path.empty() || path == "CD" || path == "CD/events";
  if (is_metavision && Hdf5Dataset::exists(file, "CD/events", H5O_TYPE_DATASET))
    return open_metavision(file);
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
