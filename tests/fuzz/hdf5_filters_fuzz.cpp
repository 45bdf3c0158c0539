// SPDX-License-Identifier: LGPL-2.1-or-later
// Arbitrary bytes as a chunk of an HDF5 file. The first five bytes are three filters, those that
// are not applied, and the size of a number.
#include <hdf5.h>

#include "src/formats/hdf5/hdf5_filters.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t before = 5;
  if (size < before) return 0;
  constexpr int known[] = {H5Z_FILTER_DEFLATE, H5Z_FILTER_SHUFFLE, H5Z_FILTER_FLETCHER32,
                           eventcamera::lzf_filter};
  const int filters[] = {known[data[0] % 4], known[data[1] % 4], known[data[2] % 4]};
  const std::size_t number_bytes = 1 + data[4] % 16;
  const auto chunk_bytes = 16 * number_bytes;
  std::vector<std::uint8_t> bytes(data + before, data + size);
  const bool sound =
      eventcamera::undo_hdf5_filters(filters, data[3], number_bytes, chunk_bytes, bytes);
  fuzz::require(!sound || bytes.size() == chunk_bytes, "a sound chunk is whole");
  fuzz::require(bytes.capacity() <= std::max(size, chunk_bytes + 64), "memory is bounded");
  return 0;
}
