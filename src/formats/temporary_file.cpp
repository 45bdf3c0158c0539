// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/temporary_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>

namespace eventcamera {

namespace {

/// Not /tmp, which may be in memory.
std::string folder_of_large_files() {
  const char* const set = std::getenv("TMPDIR");
  return set != nullptr && *set != '\0' ? set : "/var/tmp";
}

}  // namespace

TemporaryFile::TemporaryFile() : folder_(folder_of_large_files()) {
  auto path = folder_ + "/events-XXXXXX";
  descriptor_ = mkostemp(path.data(), O_CLOEXEC);
  if (descriptor_ < 0) fail(errno);
  unlink(path.c_str());
}

TemporaryFile::~TemporaryFile() {
  close(descriptor_);
}

void TemporaryFile::append(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const auto count = pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(size_));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(errno);
    size_ += static_cast<std::uint64_t>(count);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

void TemporaryFile::read(std::uint64_t position, std::span<std::uint8_t> out) const {
  while (!out.empty()) {
    const auto count = pread(descriptor_, out.data(), out.size(), static_cast<off_t>(position));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) fail(count < 0 ? errno : EIO);
    position += static_cast<std::uint64_t>(count);
    out = out.subspan(static_cast<std::size_t>(count));
  }
}

void TemporaryFile::fail(int error) const {
  throw TemporaryFileError(error, std::generic_category(), "temporary file in " + folder_);
}

}  // namespace eventcamera
