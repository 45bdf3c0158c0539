// SPDX-License-Identifier: LGPL-2.1-or-later
// Any bytes as an HDF5 file. It is the library that reads what is around the events, and its
// version 1.10 has errors of its own there: run with -fork=1 -ignore_crashes=1 -detect_leaks=0, and
// look at what has our code on top.
#include "tests/fuzz/read_hdf5.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::read_hdf5({data, size});
  return 0;
}
