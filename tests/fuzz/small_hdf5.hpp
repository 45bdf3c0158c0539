// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"

namespace fuzz {

using namespace eventcamera;

/// Builder of an HDF5 file in memory.
class SmallHdf5 {
 public:
  explicit SmallHdf5(const std::string& name) {
    const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    H5Pset_fapl_core(access.get(), 1024, false);
    file_ = {H5Fcreate(name.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.get()), H5Fclose};
  }

  hid_t id() const { return file_.get(); }

  void group(const char* name) {
    H5Gclose(H5Gcreate2(id(), name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  }

  void dataset(const char* name, hid_t type, const std::vector<hsize_t>& extent, const void* rows) {
    const auto dataset = make(name, type, extent, 0, {});
    H5Dwrite(dataset.get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows);
  }

  /// In chunks of `chunk` rows, filtered by the library.
  void packed_dataset(const char* name, hid_t type, const std::vector<hsize_t>& extent,
                      const void* rows, hsize_t chunk, int filter) {
    const auto dataset = make(name, type, extent, chunk, {filter});
    H5Dwrite(dataset.get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows);
  }

  /// In chunks of `chunk` rows, each stored as these bytes.
  void stored_dataset(const char* name, hid_t type, const std::vector<hsize_t>& extent,
                      hsize_t chunk, const std::vector<int>& filters,
                      const std::vector<std::span<const std::uint8_t>>& chunks) {
    const auto dataset = make(name, type, extent, chunk, filters);
    std::vector<hsize_t> offset(extent.size());
    for (const auto bytes : chunks) {
      if (offset[0] >= extent[0]) break;
      H5Dwrite_chunk(dataset.get(), H5P_DEFAULT, 0, offset.data(), bytes.size(), bytes.data());
      offset[0] += chunk;
    }
  }

  std::vector<std::uint8_t> bytes() const {
    H5Fflush(id(), H5F_SCOPE_GLOBAL);
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(H5Fget_file_image(id(), nullptr, 0)));
    H5Fget_file_image(id(), bytes.data(), bytes.size());
    return bytes;
  }

 private:
  Hdf5Handle make(const char* name, hid_t type, const std::vector<hsize_t>& extent, hsize_t chunk,
                  const std::vector<int>& filters) const {
    const Hdf5Handle space(
        extent.empty() ? H5Screate(H5S_SCALAR)
                       : H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr),
        H5Sclose);
    const Hdf5Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    if (chunk != 0) {
      auto sides = extent;
      sides[0] = chunk;
      H5Pset_chunk(creation.get(), static_cast<int>(sides.size()), sides.data());
      for (const int filter : filters)
        if (filter != 0) H5Pset_filter(creation.get(), filter, H5Z_FLAG_OPTIONAL, 0, nullptr);
    }
    return {H5Dcreate2(id(), name, type, space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT),
            H5Dclose};
  }

  Hdf5Handle file_;
};

inline Hdf5Handle metavision_event_type() {
  Hdf5Handle type(H5Tcreate(H5T_COMPOUND, 16), H5Tclose);
  H5Tinsert(type.get(), "x", 0, H5T_NATIVE_UINT16);
  H5Tinsert(type.get(), "y", 2, H5T_NATIVE_UINT16);
  H5Tinsert(type.get(), "p", 4, H5T_NATIVE_INT16);
  H5Tinsert(type.get(), "t", 8, H5T_NATIVE_INT64);
  return type;
}

}  // namespace fuzz
