// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <memory>
#include <system_error>
#include <utility>

namespace eventcamera {

namespace {

/// Storage of a file: one of these.
struct Storage {
  ByteSource* input = nullptr;
  Hdf5Output* output = nullptr;
};

/// State of an open file, for the library.
struct File : H5FD_t {
  explicit File(const Storage& of) : H5FD_t(), storage(of) {}

  Storage storage;
  haddr_t end = 0;  ///< end of the space that the library has allocated
};

File& file_of(H5FD_t* file) {
  return *static_cast<File*>(file);
}
const File& file_of(const H5FD_t* file) {
  return *static_cast<const File*>(file);
}

H5FD_t* open_file(const char* /*name*/, unsigned flags, hid_t access, haddr_t /*max_size*/) {
  const auto* const storage = static_cast<const Storage*>(H5Pget_driver_info(access));
  const bool writes = (flags & H5F_ACC_RDWR) != 0;
  if (storage == nullptr || (writes && storage->output == nullptr)) return nullptr;
  return std::make_unique<File>(*storage).release();
}

herr_t close_file(H5FD_t* file) {
  const std::unique_ptr<File> last(&file_of(file));
  return 0;
}

/// Lets the library aggregate metadata and small data, for fewer and larger reads and writes.
herr_t query_features(const H5FD_t* file, unsigned long* flags) {
  if (flags == nullptr) return 0;
  *flags = file != nullptr && file_of(file).storage.output != nullptr
               ? H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA |
                     H5FD_FEAT_DATA_SIEVE | H5FD_FEAT_AGGREGATE_SMALLDATA
               : H5FD_FEAT_ACCUMULATE_METADATA_READ | H5FD_FEAT_DATA_SIEVE;
  return 0;
}

haddr_t end_in_use(const H5FD_t* file, H5FD_mem_t /*type*/) {
  return file_of(file).end;
}

herr_t set_end_in_use(H5FD_t* file, H5FD_mem_t /*type*/, haddr_t end) {
  file_of(file).end = end;
  return 0;
}

haddr_t end_of_file(const H5FD_t* file, H5FD_mem_t /*type*/) {
  const auto& [input, output] = file_of(file).storage;
  return output != nullptr ? output->size() : input->size();
}

herr_t read_file(H5FD_t* file, H5FD_mem_t /*type*/, hid_t /*transfer*/, haddr_t position,
                 std::size_t bytes, void* to) {
  const auto& [input, output] = file_of(file).storage;
  const std::span out(static_cast<std::uint8_t*>(to), bytes);
  if (output != nullptr) {
    output->read(position, out);
    return 0;
  }
  const auto size = input->size();
  const bool inside = position <= size && bytes <= size - position;
  return inside && input->read(position, out) == bytes ? 0 : -1;
}

herr_t write_file(H5FD_t* file, H5FD_mem_t /*type*/, hid_t /*transfer*/, haddr_t position,
                  std::size_t bytes, const void* from) {
  auto* const output = file_of(file).storage.output;
  if (output == nullptr) return -1;
  output->write(position, {static_cast<const std::uint8_t*>(from), bytes});
  return 0;
}

herr_t truncate_file(H5FD_t* file, hid_t /*transfer*/, hbool_t /*closing*/) {
  const auto& opened = file_of(file);
  if (opened.storage.output != nullptr) opened.storage.output->truncate(opened.end);
  return 0;
}

/// Writes `bytes` at `position`, and advances both past what was written. Returns an error as in
/// errno, or 0.
int write_all(int fd, std::uint64_t& position, std::span<const std::uint8_t>& bytes) {
  while (!bytes.empty()) {
    const auto written = pwrite(fd, bytes.data(), bytes.size(), static_cast<off_t>(position));
    if (written < 0 && errno != EINTR) return errno;
    if (written <= 0) continue;
    position += static_cast<std::uint64_t>(written);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

H5FD_class_t make_driver() {
  H5FD_class_t driver = {};
#ifdef H5FD_CLASS_VERSION
  driver.version = H5FD_CLASS_VERSION;
#endif
  driver.name = "eventcamera";
  driver.maxaddr = INT64_MAX;
  driver.fc_degree = H5F_CLOSE_STRONG;
  driver.fapl_size = sizeof(Storage);
  driver.open = open_file;
  driver.close = close_file;
  driver.query = query_features;
  driver.get_eoa = end_in_use;
  driver.set_eoa = set_end_in_use;
  driver.get_eof = end_of_file;
  driver.read = read_file;
  driver.write = write_file;
  driver.truncate = truncate_file;
  return driver;
}

/// Returns the access properties to open a file in `storage`; empty on failure.
Hdf5Handle access_to(const Storage& storage) {
  static const H5FD_class_t driver = make_driver();
  static const hid_t id = H5FDregister(&driver);
  Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  if (id < 0 || H5Pset_driver(access.get(), id, &storage) < 0) return {};
  return access;
}

}  // namespace

Hdf5Handle open_hdf5(ByteSource& source) {
  const Hdf5Session session;
  const auto access = access_to({.input = &source});
  if (!access) return {};
  return {H5Fopen("events", H5F_ACC_RDONLY, access.get()), H5Fclose};
}

Hdf5Output::Hdf5Output(const std::filesystem::path& path) : path_(path) {
  constexpr mode_t mode = 0666;
  fd_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, mode);
  if (fd_ < 0) fail(errno);
  // Locks the file like the library does, so that readers detect that it is being written.
  if ((flock(fd_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) || ftruncate(fd_, 0) != 0) {
    const int error = errno;
    close(fd_);
    fail(error);
  }
}

Hdf5Output::~Hdf5Output() {
  finish_commit();
  close(fd_);
}

Hdf5Handle Hdf5Output::create() {
  const Hdf5Session session;
  const auto access = access_to({.output = this});
  if (!access) return {};
  return {H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.get()), H5Fclose};
}

void Hdf5Output::fail(int error) const {
  throw std::system_error(error, std::generic_category(), path_.string() + " cannot be written");
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
  for (const auto* const pieces : {&committing_, &held_}) {
    for (const auto& [start, bytes] : *pieces) {
      const auto begin = std::max(position, start);
      const auto end = std::min(position + out.size(), start + bytes.size());
      if (begin >= end) continue;
      std::ranges::copy(std::span(bytes).subspan(begin - start, end - begin),
                        out.begin() + static_cast<std::ptrdiff_t>(begin - position));
    }
  }
}

void Hdf5Output::write(std::uint64_t position, std::span<const std::uint8_t> bytes) {
  size_ = std::max<std::uint64_t>(size_, position + bytes.size());
  const auto replaced = committed_ - std::min(position, committed_);
  const auto first_new = std::min<std::uint64_t>(replaced, bytes.size());
  hold(position, bytes.first(first_new));
  position += first_new;
  auto rest = bytes.subspan(first_new);
  if (error_ == 0) error_ = write_all(fd_, position, rest);
  written_ = std::max(written_, position);
  hold(position, rest);
}

void Hdf5Output::hold(std::uint64_t position, std::span<const std::uint8_t> bytes) {
  if (!bytes.empty()) held_.push_back({position, {bytes.begin(), bytes.end()}});
}

void Hdf5Output::start_commit() {
  finish_commit();
  if (error_ != 0) return;
  if (size_ > written_ && ftruncate(fd_, static_cast<off_t>(size_)) != 0) {
    error_ = errno;
    return;
  }
  written_ = std::max(written_, size_);
  committed_ = size_;
  committing_ = std::exchange(held_, {});
  commit_ = std::async([this] { return write_committing(); });
}

/// Runs in another thread. Returns an error as in errno, or 0.
int Hdf5Output::write_committing() const {
  // New bytes reach the disk before the pointers to them. Some file systems cannot sync.
  if (fdatasync(fd_) != 0 && errno != EINVAL) return errno;
  for (const auto& [position, bytes] : committing_) {
    auto begin = position;
    std::span<const std::uint8_t> rest = bytes;
    if (const int error = write_all(fd_, begin, rest); error != 0) return error;
  }
  return 0;
}

bool Hdf5Output::is_committing() const {
  return commit_.valid() &&
         commit_.wait_for(std::chrono::seconds(0)) == std::future_status::timeout;
}

void Hdf5Output::finish_commit() {
  if (!commit_.valid()) return;
  const int error = commit_.get();
  if (error == 0)
    committing_.clear();
  else if (error_ == 0)
    error_ = error;
}

void Hdf5Output::finish() {
  start_commit();
  finish_commit();
  if (error_ == 0 && ftruncate(fd_, static_cast<off_t>(size_)) != 0) error_ = errno;
}

}  // namespace eventcamera
