// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_output.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <system_error>

#include "src/formats/hdf5/hdf5_driver.hpp"

namespace eventcamera {

namespace {

/// A file that is written.
struct OutputStorage {
  static constexpr const char* name = "eventcamera output";
  static constexpr bool is_writable = true;
  /// The library gathers what is small.
  static constexpr unsigned long features = H5FD_FEAT_AGGREGATE_METADATA |
                                            H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
                                            H5FD_FEAT_AGGREGATE_SMALLDATA;

  std::uint64_t size() const { return output->size(); }

  bool read(std::uint64_t position, std::span<std::uint8_t> out) const {
    output->read(position, out);
    return true;
  }

  bool write(std::uint64_t position, std::span<const std::uint8_t> bytes) const {
    output->write(position, bytes);
    return true;
  }

  void truncate(std::uint64_t size) const { output->truncate(size); }

  Hdf5Output* output;
};

}  // namespace

Hdf5Output::Hdf5Output(const std::filesystem::path& path) : path_(path) {
  constexpr mode_t mode = 0666;
  fd_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, mode);
  if (fd_ < 0) fail(errno);
  // As the library itself does: who reads a file that is being written is told so.
  if ((flock(fd_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) || ftruncate(fd_, 0) != 0) {
    const int error = errno;
    close(fd_);
    fail(error);
  }
}

Hdf5Output::~Hdf5Output() {
  close(fd_);
}

Hdf5Handle Hdf5Output::create() {
  const Hdf5Session session;
  const auto access = Hdf5Driver<OutputStorage>::access_to({this});
  if (!access) return {};
  return {H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.get()), H5Fclose};
}

void Hdf5Output::fail(int error) const {
  throw std::runtime_error(path_.string() +
                           " cannot be written: " + std::generic_category().message(error));
}

void Hdf5Output::check() const {
  if (error_ != 0) fail(error_);
}

void Hdf5Output::read(std::uint64_t position, std::span<std::uint8_t> out) const {
  auto left = out;
  for (auto at = position; !left.empty();) {
    const auto got = pread(fd_, left.data(), left.size(), static_cast<off_t>(at));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    at += static_cast<std::uint64_t>(got);
    left = left.subspan(static_cast<std::size_t>(got));
  }
  std::ranges::fill(left, 0);
  for (const auto& [start, bytes] : unwritten_) {
    const auto begin = std::max(position, start);
    const auto end = std::min(position + out.size(), start + bytes.size());
    if (begin >= end) continue;
    std::ranges::copy(std::span(bytes).subspan(begin - start, end - begin),
                      out.begin() + static_cast<std::ptrdiff_t>(begin - position));
  }
}

void Hdf5Output::write(std::uint64_t position, std::span<const std::uint8_t> bytes) {
  size_ = std::max<std::uint64_t>(size_, position + bytes.size());
  while (!bytes.empty() && error_ == 0) {
    const auto put = pwrite(fd_, bytes.data(), bytes.size(), static_cast<off_t>(position));
    if (put < 0 && errno != EINTR) error_ = errno;
    if (put <= 0) continue;
    position += static_cast<std::uint64_t>(put);
    bytes = bytes.subspan(static_cast<std::size_t>(put));
  }
  if (!bytes.empty()) unwritten_.push_back({position, {bytes.begin(), bytes.end()}});
}

void Hdf5Output::truncate(std::uint64_t size) {
  if (size_ == size || error_ != 0) return;
  size_ = size;
  if (ftruncate(fd_, static_cast<off_t>(size)) != 0) error_ = errno;
}

}  // namespace eventcamera
