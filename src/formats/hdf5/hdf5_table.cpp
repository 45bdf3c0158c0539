// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_table.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "src/core/max_side.hpp"
#include "src/formats/hdf5/dsec_table.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/ecf_table.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"
#include "src/formats/hdf5/row_table.hpp"
#include "src/formats/unsupported_format.hpp"

namespace eventcamera {

namespace {

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
  if (events.has_only_filter(ecf_filter)) return make_ecf_table(std::move(events), size);
  return make_row_table(Hdf5Format::metavision, std::move(events), path, size,
                        ColumnOrder{0, 1, 2, 3}, TimeUnit::microseconds);
}

/// Names that belong to t, x, y and p.
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

/// Creates the table of a dataset whose rows are events: records with members t, x, y and p, or
/// rows of four numbers. Throws UnsupportedFormat.
std::unique_ptr<Hdf5Table> open_rows(hid_t file, const std::string& path) {
  Hdf5Dataset events(file, path);
  auto size = size_of_attributes(file);
  if (size == SensorSize{}) size = size_of_frames(file);
  if (const auto members = events.members(); !members.empty()) {
    NamedColumns columns;
    for (const auto& member : members) columns.add(member);
    if (!columns.are_complete())
      throw UnsupportedFormat("HDF5 dataset /" + path + " has no members t, x, y and p");
    events.choose(columns.names);
    return make_row_table(Hdf5Format::v2e, std::move(events), path, size, ColumnOrder{0, 1, 2, 3},
                          columns.unit);
  }
  if (events.rank() != 2 || events.columns() != event_columns || !events.is_numbers())
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
  std::optional<ColumnOrder> order;
  if (is_mvsec) order = ColumnOrder{2, 0, 1, 3};
  if (events.is_integers()) order = ColumnOrder{0, 1, 2, 3};  // v2e
  std::optional<TimeUnit> unit;
  if (is_mvsec) unit = TimeUnit::seconds;
  return make_row_table(is_mvsec ? Hdf5Format::mvsec : Hdf5Format::v2e, std::move(events), path,
                        size, order, unit);
}

/// Searches a file for events.
class EventSearch {
 public:
  explicit EventSearch(hid_t file) : file_(file) {}

  /// Returns the events of the first group that has some, of those closest to the root. Throws
  /// UnsupportedFormat.
  std::unique_ptr<Hdf5Table> find() {
    for (std::vector<std::string> groups = {""}; !groups.empty();) {
      std::vector<std::string> next;
      for (const auto& group : groups)
        if (auto table = find_in(group, next)) return table;
      groups = ++depth_ < max_depth ? std::move(next) : std::vector<std::string>();
    }
    if (!cause_.empty()) throw UnsupportedFormat(cause_);
    throw UnsupportedFormat(
        "no events in the HDF5 file: it needs four datasets of a group that are named t, x, y and "
        "p "
        "(or xs, timestamp, polarity and the like), or one named events, with these members or "
        "columns");
  }

 private:
  static constexpr int max_depth = 6;
  static constexpr std::size_t max_links = 4096;

  /// Returns the events of a group, or else appends its groups to `next`.
  std::unique_ptr<Hdf5Table> find_in(const std::string& group, std::vector<std::string>& next) {
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
    // Events of a right camera are after those of a left one, in the order of names.
    if (columns.are_complete()) return make_dsec_table(file_, {group, columns.names, columns.unit});
    for (const auto& path : rows) {
      try {
        return open_rows(file_, path);
      } catch (const UnsupportedFormat& error) {
        if (cause_.empty()) cause_ = error.what();
      }
    }
    return nullptr;
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
  int depth_ = 0;
  std::size_t links_ = 0;
  std::string cause_;  ///< what was wrong with the first dataset that may be one of events
};

}  // namespace

SensorSize size_of_attributes(hid_t object) {
  const auto width = read_number_attribute(object, "width");
  const auto height = read_number_attribute(object, "height");
  if (width && height && is_side(*width) && is_side(*height))
    return {static_cast<int>(*width), static_cast<int>(*height)};
  // Some tools state the height first; no sensor is upright.
  for (const char* const name :
       {"sensor_resolution", "sensor_size", "sensor_shape", "resolution"}) {
    const auto pair = read_pair_attribute(object, name);
    if (pair && is_side((*pair)[0]) && is_side((*pair)[1]))
      return {static_cast<int>(std::max((*pair)[0], (*pair)[1])),
              static_cast<int>(std::min((*pair)[0], (*pair)[1]))};
  }
  return {};
}

std::unique_ptr<Hdf5Table> Hdf5Table::open(hid_t file) {
  if (Hdf5Dataset::exists(file, "CD/events", H5O_TYPE_DATASET)) return open_metavision(file);
  return EventSearch(file).find();
}

}  // namespace eventcamera
