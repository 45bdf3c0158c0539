// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "src/formats/byte_source.hpp"
#include "src/formats/event_file.hpp"
#include "src/formats/event_validator.hpp"
#include "src/formats/hdf5/hdf5_layout.hpp"

namespace eventcamera {

class Hdf5Table;
class Hdf5Triggers;

/// Reads an HDF5 file of events, whichever layout it has. Rows that are corrupt are left out.
class Hdf5Reader final : public EventFile {
 public:
  /// Throws UnsupportedFormat, or std::runtime_error where the file cannot be opened.
  explicit Hdf5Reader(const std::filesystem::path& path);
  explicit Hdf5Reader(std::unique_ptr<ByteSource> bytes);
  ~Hdf5Reader() override;

  Hdf5Layout layout() const { return layout_; }

  SensorSize size() const override { return size_; }

  /// How many events there are.
  std::uint64_t count() const;

  std::optional<TimeRange> time_range() const override;
  std::size_t read(std::size_t count, std::vector<AbsoluteEvent>& out) override;
  /// Only Metavision's layout has triggers.
  std::size_t read_triggers(std::size_t count, std::vector<Trigger>& out) override;
  void seek(Microseconds t) override;
  const Corruption& corruption() const override { return corruption_; }

 private:
  struct File;
  explicit Hdf5Reader(File file);

  void fill();

  std::unique_ptr<File> file_;
  Hdf5Layout layout_ = Hdf5Layout::dsec;
  SensorSize size_;
  std::unique_ptr<Hdf5Table> table_;
  std::unique_ptr<Hdf5Triggers> triggers_;
  EventValidator validator_;
  Corruption corruption_;

  std::uint64_t row_ = 0;              ///< to be read next
  std::vector<AbsoluteEvent> events_;  ///< read, the first taken_ of them handed over
  std::size_t taken_ = 0;
  std::optional<Microseconds> not_before_;  ///< until an event is there
};

}  // namespace eventcamera
