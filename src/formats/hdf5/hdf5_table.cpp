// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_table.hpp"

#include <charconv>
#include <string>
#include <utility>

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

std::unique_ptr<Hdf5Table> open_v2e(hid_t file) {
  Hdf5Dataset events(file, "events");
  if (events.rank() != 2 || events.columns() != event_columns || !events.is_integers())
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
  return make_row_table(Hdf5Format::v2e, std::move(events), size, wraps);
}

/// MVSEC (A. Z. Zhu et al., "The Multi Vehicle Stereo Event Camera Dataset", 2018): rows of
/// fractional numbers x, y, t in seconds and p, 1 or -1, of a DAVIS 346B.
std::unique_ptr<Hdf5Table> open_mvsec(hid_t file) {
  constexpr std::size_t time_column = 2;
  Hdf5Dataset events(file, "davis/left/events");
  if (events.rank() != 2 || events.columns() != event_columns ||
      !events.read_fractions(time_column))
    throw UnsupportedFormat(
        "HDF5 dataset /davis/left/events must hold rows of four fractional numbers x, y, t and p");
  return make_row_table(Hdf5Format::mvsec, std::move(events), SensorSize{346, 260}, false,
                        ColumnOrder{time_column, 0, 1, 3});
}

std::unique_ptr<Hdf5Table> open_metavision(hid_t file) {
  Hdf5Dataset events(file, "CD/events");
  if (events.rank() != 1) throw UnsupportedFormat("HDF5 dataset /CD/events must hold rows");
  constexpr const char* members[] = {"t", "x", "y", "p"};
  events.choose(members);
  const auto size = read_geometry(read_text_attribute(file, "geometry").value_or(""));
  if (events.has_only_filter(ecf_filter)) return make_ecf_table(std::move(events), size);
  return make_row_table(Hdf5Format::metavision, std::move(events), size, false);
}

}  // namespace

std::unique_ptr<Hdf5Table> Hdf5Table::open(hid_t file) {
  if (Hdf5Dataset::exists(file, "CD/events", H5O_TYPE_DATASET)) return open_metavision(file);
  for (const char* const group : {"events", "raw_events"})
    if (Hdf5Dataset::exists(file, std::string(group) + "/t", H5O_TYPE_DATASET))
      return make_dsec_table(file, group);
  if (Hdf5Dataset::exists(file, "davis/left/events", H5O_TYPE_DATASET)) return open_mvsec(file);
  if (Hdf5Dataset::exists(file, "events", H5O_TYPE_DATASET)) return open_v2e(file);
  throw UnsupportedFormat(
      "none of the known HDF5 layouts: /events/t (DSEC, TUM-VIE), /raw_events/t, /events (v2e), "
      "/CD/events (Metavision), /davis/left/events (MVSEC)");
}

}  // namespace eventcamera
