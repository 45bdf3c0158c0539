// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_input.hpp"

#include "src/formats/hdf5/hdf5_driver.hpp"

namespace eventcamera {

namespace {

/// A file that is only read.
struct InputStorage {
  static constexpr const char* name = "eventcamera";
  static constexpr bool is_writable = false;
  /// The library reads its small structures, and the data, in larger pieces.
  static constexpr unsigned long features =
      H5FD_FEAT_ACCUMULATE_METADATA_READ | H5FD_FEAT_DATA_SIEVE;

  std::uint64_t size() const { return source->size(); }

  bool read(std::uint64_t position, std::span<std::uint8_t> out) const {
    const auto size = source->size();
    if (position > size || out.size() > size - position) return false;
    return source->read(position, out) == out.size();
  }

  static bool write(std::uint64_t /*position*/, std::span<const std::uint8_t> /*bytes*/) {
    return false;
  }

  static void truncate(std::uint64_t /*size*/) {}

  ByteSource* source;
};

}  // namespace

Hdf5Handle open_hdf5(ByteSource& source) {
  const Hdf5Session session;
  const auto access = Hdf5Driver<InputStorage>::access_to({&source});
  if (!access) return {};
  return {H5Fopen("events", H5F_ACC_RDONLY, access.get()), H5Fclose};
}

}  // namespace eventcamera
