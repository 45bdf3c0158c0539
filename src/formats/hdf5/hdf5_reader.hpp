// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "src/formats/byte_source.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/hdf5/hdf5_layout.hpp"
#include "src/formats/reader.hpp"

namespace eventcamera {

class Hdf5Table;
class Hdf5Triggers;

/// Reads an HDF5 file of events, whichever layout it has. Rows that are corrupt are left out.
class Hdf5Reader {
 public:
  struct TimeRange {
    Microseconds first, last;
  };

  /// Throws UnsupportedFormat, or std::runtime_error where the file cannot be opened.
  explicit Hdf5Reader(const std::filesystem::path& path);
  explicit Hdf5Reader(std::unique_ptr<ByteSource> bytes);
  /// Of bytes that outlive the reader.
  explicit Hdf5Reader(ByteSource& bytes);
  ~Hdf5Reader();
  Hdf5Reader(const Hdf5Reader&) = delete;
  Hdf5Reader& operator=(const Hdf5Reader&) = delete;

  Hdf5Layout layout() const { return layout_; }

  /// The sensor's size, where the file tells it; else 0x0.
  SensorSize size() const { return size_; }

  /// How many events there are.
  std::uint64_t count() const;

  /// The times of the first and the last event; nothing where there are none.
  std::optional<TimeRange> time_range() const;

  /// Appends up to `count` events, fewer only at the end, and returns how many.
  std::size_t read(std::size_t count, std::vector<AbsoluteEvent>& out);

  /// The same for triggers, which only Metavision's layout has.
  std::size_t read_triggers(std::size_t count, std::vector<Trigger>& out);

  /// Goes to the first event and the first trigger at `t` or later.
  void seek(Microseconds t);

  const Corruption& corruption() const { return corruption_; }

 private:
  struct File;
  explicit Hdf5Reader(File file);

  void fill();

  std::unique_ptr<File> file_;
  Hdf5Layout layout_ = Hdf5Layout::dsec;
  SensorSize size_;
  std::unique_ptr<Hdf5Table> table_;
  std::unique_ptr<Hdf5Triggers> triggers_;
  RowValidator validator_;
  Corruption corruption_;

  std::uint64_t row_ = 0;              ///< to be read next
  std::vector<AbsoluteEvent> events_;  ///< read, the first taken_ of them handed over
  std::size_t taken_ = 0;
  std::optional<Microseconds> not_before_;  ///< until an event is there
};

/// Reads an HDF5 file that is opened, or one that is pushed: that is collected in memory, up to
/// 256 MiB, and read at its end, because what is needed next lies anywhere in it.
std::unique_ptr<Reader> make_hdf5_reader();

}  // namespace eventcamera
