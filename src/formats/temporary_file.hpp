// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <system_error>

namespace eventcamera {

/// Failure of a temporary file; its text names the folder and the cause.
class TemporaryFileError : public std::system_error {
 public:
  using std::system_error::system_error;
};

/// File without a name, which disappears when it is closed, in the folder of the environment
/// variable TMPDIR, or else in /var/tmp. Functions throw TemporaryFileError.
class TemporaryFile {
 public:
  TemporaryFile();
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  std::uint64_t size() const { return size_; }
  void append(std::span<const std::uint8_t> bytes);

  /// Reads bytes from `position` on, all of which must be in the file.
  void read(std::uint64_t position, std::span<std::uint8_t> out) const;

 private:
  [[noreturn]] void fail(int error) const;

  std::string folder_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
};

}  // namespace eventcamera
