// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <vector>

#include "src/core/event.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/hdf5/hdf5_dataset.hpp"

namespace eventcamera {

/// Triggers of the Metavision layout.
class Hdf5Triggers {
 public:
  /// Returns null if the file has none.
  static std::unique_ptr<Hdf5Triggers> open(hid_t file);

  /// Appends a bounded number of triggers from the next row on. False at the end.
  bool read(std::size_t count, std::vector<Trigger>& out, Corruption& corruption);
  void seek(Microseconds t);

 private:
  explicit Hdf5Triggers(hid_t file);

  Hdf5Dataset dataset_;
  std::uint64_t row_ = 0;
  std::vector<std::int64_t> numbers_;  ///< t, p and id of each row
};

}  // namespace eventcamera
