// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <future>
#include <span>
#include <vector>

#include "src/formats/byte_source.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

/// Opens an HDF5 file for reading from `source`, which must outlive the handle. The handle is empty
/// on failure.
Hdf5Handle open_hdf5(ByteSource& source);

/// Output file of the HDF5 library that stays readable if the process is killed: new bytes are
/// appended to the file, and bytes that overwrite committed ones are held until the next commit.
///
/// After a failed write, as on a full disk, the library crashes when it closes the file or when the
/// process ends. So every write reports success to the library; callers must call check() and stop
/// writing after an error.
class Hdf5Output {
 public:
  /// Overwrites an existing file. Throws std::system_error.
  explicit Hdf5Output(const std::filesystem::path& path);
  ~Hdf5Output();
  Hdf5Output(const Hdf5Output&) = delete;
  Hdf5Output& operator=(const Hdf5Output&) = delete;

  /// Creates the library's handle, which must be closed before this object is destroyed. Empty on
  /// failure.
  Hdf5Handle create();

  /// Commits flushed data in the background: syncs the new bytes, then writes the
  /// held ones. Waits for an earlier commit.
  void start_commit();
  bool is_committing() const;
  void finish_commit();

  /// Completes the file after the library has closed it.
  void finish();

  /// Throws std::system_error if a write failed.
  void check() const {
    if (error_ != 0) fail(error_);
  }

  // Called by the library.
  void read(std::uint64_t position, std::span<std::uint8_t> out) const;
  void write(std::uint64_t position, std::span<const std::uint8_t> bytes);
  void truncate(std::uint64_t size) { size_ = size; }
  std::uint64_t size() const { return size_; }

 private:
  struct Piece {
    std::uint64_t position;
    std::vector<std::uint8_t> bytes;
  };

  int write_committing() const;
  void hold(std::uint64_t position, std::span<const std::uint8_t> bytes);
  [[noreturn]] void fail(int error) const;

  std::filesystem::path path_;
  int fd_ = -1;
  int error_ = 0;                ///< first error, as in errno
  std::uint64_t size_ = 0;       ///< as seen by the library
  std::uint64_t written_ = 0;    ///< size of the file
  std::uint64_t committed_ = 0;  ///< size at the start of the last commit
  /// Writes below committed_, and failed ones, which the library may read again.
  std::vector<Piece> held_;
  std::vector<Piece> committing_;  ///< held pieces that the last commit writes
  std::future<int> commit_;        ///< error of the last commit, while it runs
};

}  // namespace eventcamera
