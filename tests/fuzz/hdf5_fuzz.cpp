// SPDX-License-Identifier: LGPL-2.1-or-later
// Arbitrary bytes as an HDF5 file. The library reads everything but the events, and its version
// 1.10 has bugs there: run with -fork=1 -ignore_crashes=1 -detect_leaks=0, and look at crashes with
// this project's code at the top.
#include "tests/fuzz/read_hdf5.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::read_hdf5({data, size});
  return 0;
}
