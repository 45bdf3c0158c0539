// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_triggers.hpp"

#include <algorithm>

#include "src/formats/hdf5/hdf5_rows.hpp"
#include "src/formats/unsupported_format.hpp"

namespace eventcamera {

Hdf5Triggers::Hdf5Triggers(hid_t file) : dataset_(file, "EXT_TRIGGER/events") {
  if (dataset_.rank() != 1)
    throw UnsupportedFormat("HDF5 dataset /EXT_TRIGGER/events must hold rows");
  const std::string members[] = {"t", "p", "id"};
  dataset_.choose(members);
  dataset_.require_filters();
}

std::unique_ptr<Hdf5Triggers> Hdf5Triggers::open(hid_t file) {
  if (!Hdf5Dataset::exists(file, "EXT_TRIGGER/events", H5O_TYPE_DATASET)) return nullptr;
  return std::unique_ptr<Hdf5Triggers>(new Hdf5Triggers(file));
}

bool Hdf5Triggers::read(std::size_t count, std::vector<Trigger>& out, Corruption& corruption) {
  if (row_ >= dataset_.rows() || count == 0) return false;
  const auto end = std::min<std::uint64_t>(block_end(row_, dataset_.rows()), row_ + count);
  if (dataset_.read(row_, end - row_, numbers_)) {
    for (std::size_t i = 0; i < numbers_.size(); i += 3)
      out.push_back(
          {numbers_[i], static_cast<std::uint16_t>(numbers_[i + 2]), numbers_[i + 1] > 0});
  } else {
    note(corruption, dataset_, row_, "unreadable part of an HDF5 dataset");
  }
  row_ = end;
  return true;
}

void Hdf5Triggers::seek(Microseconds t) {
  row_ = first_row(dataset_.rows(), [&](std::uint64_t row) {
    return dataset_.read(row, 1, numbers_) && numbers_[0] < t;
  });
}

}  // namespace eventcamera
