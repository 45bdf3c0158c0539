// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <hdf5.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>

#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

/// Lets the HDF5 library reach the bytes of a file through a Storage: a few pointers, copied, that
/// have name, features (H5FD_FEAT_*), is_writable, size(), read(), write() and truncate().
template <class Storage>
class Hdf5Driver {
  static_assert(std::is_trivially_copyable_v<Storage>);

 public:
  /// With these properties of access the library opens a file that lies there. Empty where it
  /// cannot.
  static Hdf5Handle access_to(const Storage& storage) {
    static const H5FD_class_t driver = make();
    static const hid_t id = H5FDregister(&driver);
    Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    if (id < 0 || H5Pset_driver(access.get(), id, &storage) < 0) return {};
    return access;
  }

 private:
  /// What the library knows of an open file.
  struct File : H5FD_t {
    explicit File(const Storage& of) : H5FD_t(), storage(of) {}

    Storage storage;
    haddr_t end = 0;  ///< of what the library takes to be in use
  };

  static File& file_of(H5FD_t* file) { return *static_cast<File*>(file); }
  static const File& file_of(const H5FD_t* file) { return *static_cast<const File*>(file); }

  static H5FD_t* open(const char* /*name*/, unsigned flags, hid_t access, haddr_t /*most*/) {
    if ((flags & H5F_ACC_RDWR) != 0 && !Storage::is_writable) return nullptr;
    const auto* const storage = static_cast<const Storage*>(H5Pget_driver_info(access));
    return storage == nullptr ? nullptr : std::make_unique<File>(*storage).release();
  }

  static herr_t close(H5FD_t* file) {
    const std::unique_ptr<File> last(&file_of(file));
    return 0;
  }

  static herr_t tell_features(const H5FD_t* /*file*/, unsigned long* flags) {
    if (flags != nullptr) *flags = Storage::features;
    return 0;
  }

  static haddr_t end_in_use(const H5FD_t* file, H5FD_mem_t /*type*/) { return file_of(file).end; }

  static herr_t set_end_in_use(H5FD_t* file, H5FD_mem_t /*type*/, haddr_t end) {
    file_of(file).end = end;
    return 0;
  }

  static haddr_t end_of_file(const H5FD_t* file, H5FD_mem_t /*type*/) {
    return file_of(file).storage.size();
  }

  static herr_t read(H5FD_t* file, H5FD_mem_t /*type*/, hid_t /*transfer*/, haddr_t position,
                     std::size_t bytes, void* out) {
    return file_of(file).storage.read(position, {static_cast<std::uint8_t*>(out), bytes}) ? 0 : -1;
  }

  static herr_t write(H5FD_t* file, H5FD_mem_t /*type*/, hid_t /*transfer*/, haddr_t position,
                      std::size_t bytes, const void* from) {
    const std::span written(static_cast<const std::uint8_t*>(from), bytes);
    return file_of(file).storage.write(position, written) ? 0 : -1;
  }

  static herr_t truncate(H5FD_t* file, hid_t /*transfer*/, hbool_t /*closing*/) {
    file_of(file).storage.truncate(file_of(file).end);
    return 0;
  }

  static H5FD_class_t make() {
    H5FD_class_t driver = {};
#ifdef H5FD_CLASS_VERSION
    driver.version = H5FD_CLASS_VERSION;
#endif
    driver.name = Storage::name;
    driver.maxaddr = INT64_MAX;
    driver.fc_degree = H5F_CLOSE_STRONG;
    driver.fapl_size = sizeof(Storage);
    driver.open = open;
    driver.close = close;
    driver.query = tell_features;
    driver.get_eoa = end_in_use;
    driver.set_eoa = set_end_in_use;
    driver.get_eof = end_of_file;
    driver.read = read;
    driver.write = write;
    driver.truncate = truncate;
    return driver;
  }
};

}  // namespace eventcamera
