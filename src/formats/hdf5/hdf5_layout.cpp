// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_layout.hpp"

#include <stdexcept>

namespace eventcamera {

void require(bool succeeded) {
  if (!succeeded) throw std::runtime_error("the HDF5 library failed to write the file");
}

Hdf5Handle make_group(hid_t file, const char* name) {
  Hdf5Handle group(H5Gcreate2(file, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  require(static_cast<bool>(group));
  return group;
}

Hdf5Handle make_creation() {
  Hdf5Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  require(H5Pset_obj_track_times(creation.get(), false) >= 0);
  return creation;
}

GrowingDataset::GrowingDataset(hid_t parent, const char* name, hid_t stored, hid_t memory,
                               hsize_t chunk, Hdf5Compression compression, int filter)
    : memory_(memory) {
  constexpr hsize_t none = 0;
  constexpr hsize_t no_limit = H5S_UNLIMITED;
  constexpr unsigned level = 1;  // the fastest; others hardly make events smaller
  const Hdf5Handle space(H5Screate_simple(1, &none, &no_limit), H5Sclose);
  const auto creation = make_creation();
  require(H5Pset_chunk(creation.get(), 1, &chunk) >= 0);
  if (compression == Hdf5Compression::gzip)
    require(H5Pset_shuffle(creation.get()) >= 0 && H5Pset_deflate(creation.get(), level) >= 0);
  if (filter != 0)
    require(H5Pset_filter(creation.get(), filter, H5Z_FLAG_OPTIONAL, 0, nullptr) >= 0);
  dataset_ = {
      H5Dcreate2(parent, name, stored, space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT),
      H5Dclose};
  require(static_cast<bool>(dataset_));
}

void GrowingDataset::append(const void* rows, hsize_t count) {
  if (count == 0) return;
  const auto begin = rows_;
  extend(count);
  const auto space = select(begin, count);
  const Hdf5Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
  require(H5Dwrite(dataset_.get(), memory_, memory.get(), space.get(), H5P_DEFAULT, rows) >= 0);
}

void GrowingDataset::write_chunk(std::span<const std::uint8_t> chunk, hsize_t begin,
                                 hsize_t count) {
  extend(begin + count - rows_);
  require(H5Dwrite_chunk(dataset_.get(), H5P_DEFAULT, 0, &begin, chunk.size(), chunk.data()) >= 0);
}

void GrowingDataset::read(hsize_t first, hsize_t count, void* rows) const {
  const auto space = select(first, count);
  const Hdf5Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
  require(H5Dread(dataset_.get(), memory_, memory.get(), space.get(), H5P_DEFAULT, rows) >= 0);
}

void GrowingDataset::extend(hsize_t count) {
  rows_ += count;
  require(H5Dset_extent(dataset_.get(), &rows_) >= 0);
}

Hdf5Handle GrowingDataset::select(hsize_t first, hsize_t count) const {
  Hdf5Handle space(H5Dget_space(dataset_.get()), H5Sclose);
  require(H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, &first, nullptr, &count, nullptr) >= 0);
  return space;
}

}  // namespace eventcamera
