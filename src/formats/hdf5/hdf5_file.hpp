// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "src/formats/byte_source.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

/// Opens a file of the HDF5 library, to be read from a source that has to live for as long. An
/// empty handle where the library cannot.
Hdf5Handle open_hdf5(ByteSource& source);

/// A file that the HDF5 library writes. The library does not survive a write that fails, as on a
/// full disk: it crashes as it closes the file, or as the process ends. So to the library every
/// write succeeds, and whoever calls it looks here for what went wrong, and then writes no more.
class Hdf5Output {
 public:
  /// Overwrites what is there. Throws std::runtime_error.
  explicit Hdf5Output(const std::filesystem::path& path);
  ~Hdf5Output();
  Hdf5Output(const Hdf5Output&) = delete;
  Hdf5Output& operator=(const Hdf5Output&) = delete;

  /// The library's handle, which must be closed before this is gone. Empty where it cannot.
  Hdf5Handle create();

  /// Throws std::runtime_error where something could not be written.
  void check() const;

  // For the library.
  void read(std::uint64_t position, std::span<std::uint8_t> out) const;
  void write(std::uint64_t position, std::span<const std::uint8_t> bytes);
  void truncate(std::uint64_t size);
  std::uint64_t size() const { return size_; }

 private:
  struct Piece {
    std::uint64_t position;
    std::vector<std::uint8_t> bytes;
  };

  [[noreturn]] void fail(int error) const;

  std::filesystem::path path_;
  int fd_ = -1;
  int error_ = 0;                 ///< the first, as of errno
  std::uint64_t size_ = 0;        ///< as the library sees it
  std::vector<Piece> unwritten_;  ///< what the library may read again as it closes the file
};

}  // namespace eventcamera
