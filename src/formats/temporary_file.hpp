// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdlib>
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
  TemporaryFile() : folder_(folder_of_large_files()) {
    auto path = folder_ + "/events-XXXXXX";
    descriptor_ = mkostemp(path.data(), O_CLOEXEC);
    if (descriptor_ < 0) fail(errno);
    unlink(path.c_str());
  }

  ~TemporaryFile() { close(descriptor_); }

  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  std::uint64_t size() const { return size_; }

  void append(std::span<const std::uint8_t> bytes) {
    while (!bytes.empty()) {
      const auto count = pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(size_));
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) fail(errno);
      size_ += static_cast<std::uint64_t>(count);
      bytes = bytes.subspan(static_cast<std::size_t>(count));
    }
  }

  /// Reads bytes from `position` on, all of which must be in the file.
  void read(std::uint64_t position, std::span<std::uint8_t> out) const {
    while (!out.empty()) {
      const auto count = pread(descriptor_, out.data(), out.size(), static_cast<off_t>(position));
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) fail(count < 0 ? errno : EIO);
      position += static_cast<std::uint64_t>(count);
      out = out.subspan(static_cast<std::size_t>(count));
    }
  }

 private:
  /// Not /tmp, which may be in memory.
  static std::string folder_of_large_files() {
    const char* const set = std::getenv("TMPDIR");
    return set != nullptr && *set != '\0' ? set : "/var/tmp";
  }

  [[noreturn]] void fail(int error) const {
    throw TemporaryFileError(error, std::generic_category(), "temporary file in " + folder_);
  }

  std::string folder_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
};

}  // namespace eventcamera
