// SPDX-License-Identifier: LGPL-2.1-or-later
// Arbitrary bytes as the chunks of a valid HDF5 file. The first five bytes are the layout, the
// filters, the rows of a chunk, the rows of the file, and the number type.
#include "src/formats/hdf5/hdf5_handle.hpp"
#include "tests/fuzz/read_hdf5.hpp"
#include "tests/fuzz/small_hdf5.hpp"

namespace {

using namespace fuzz;

hid_t number_type(unsigned choice) {
  const hid_t types[] = {H5T_STD_U32LE, H5T_STD_I64BE, H5T_STD_U8LE,
                         H5T_STD_I16LE, H5T_STD_U64LE, H5T_STD_I8LE};
  return types[choice % 6];
}

}  // namespace

/// The library keeps half a megabyte of memory per opened file.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  constexpr int bytes = 16 << 20;
  H5set_free_list_limits(bytes, bytes, bytes, bytes, bytes, bytes);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 5) return 0;
  const std::vector<int> filters = {(data[1] & 2) != 0 ? H5Z_FILTER_SHUFFLE : 0,
                                    (data[1] & 1) != 0 ? H5Z_FILTER_DEFLATE : 0};
  const hsize_t chunk = 1U + data[2];
  const hsize_t rows = 1U + data[3];
  const auto number = number_type(data[4]);
  const std::span bytes(data + 5, size - 5);
  const std::vector chunks = {bytes, bytes.first(bytes.size() / 2), bytes};
  std::vector<std::uint8_t> image;
  {
    const Hdf5Session session;
    SmallHdf5 file("fuzz");
    switch (data[0] % 4) {
      case 0:
        file.group("events");
        for (const auto* const name : {"events/t", "events/x", "events/y", "events/p"})
          file.stored_dataset(name, number, {rows}, chunk, filters, chunks);
        file.stored_dataset("ms_to_idx", number, {rows}, chunk, filters, chunks);
        file.stored_dataset("t_offset", number, {1}, chunk, filters, chunks);
        break;
      case 1:
        file.stored_dataset("events", number, {rows, 4}, chunk, filters, chunks);
        break;
      default: {
        file.group("CD");
        const auto type = metavision_event_type();
        const bool ecf = data[0] % 4 == 2;
        file.stored_dataset("CD/events", type.get(), {rows}, chunk,
                            ecf ? std::vector{ecf_filter} : filters, chunks);
        write_text_attribute(file.id(), "geometry", "640x480");
      }
    }
    image = file.bytes();
  }
  read_hdf5(image);
  return 0;
}
