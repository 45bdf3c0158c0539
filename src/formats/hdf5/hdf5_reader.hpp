// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/hdf5/hdf5_format.hpp"

namespace eventcamera {

class Hdf5Table;
class Hdf5Triggers;

/// Reads the events of an HDF5 file of any known layout. Skips corrupt rows.
class Hdf5Reader {
 public:
  struct TimeRange {
    Microseconds first, last;
  };

  /// Throws UnsupportedFormat if it cannot be read.
  explicit Hdf5Reader(std::unique_ptr<ByteSource> bytes, const Hdf5Selection& selection = {});
  /// `bytes` must outlive the reader.
  explicit Hdf5Reader(ByteSource& bytes, const Hdf5Selection& selection = {});
  ~Hdf5Reader();
  Hdf5Reader(const Hdf5Reader&) = delete;
  Hdf5Reader& operator=(const Hdf5Reader&) = delete;

  /// Sensor size; 0x0 if not stated in the file.
  SensorSize size() const { return size_; }

  /// True if events carry labels.
  bool has_labels() const { return has_labels_; }

  /// Paths of other events in the file, for users; empty if there are none, or a path was selected.
  std::string others() const;

  /// Times of the first and last event; nothing if there are none.
  std::optional<TimeRange> time_range() const;

  /// Appends up to `count` events, fewer only at the end, and returns their number.
  std::size_t read(std::size_t count, std::vector<AbsoluteEvent>& out);

  /// The same for triggers, which only the Metavision layout has.
  std::size_t read_triggers(std::size_t count, std::vector<Trigger>& out);

  /// Goes to the first event and the first trigger at `t` or later.
  void seek(Microseconds t);

  const Corruption& corruption() const { return corruption_; }

 private:
  struct File;

  void fill();

  std::unique_ptr<ByteSource> bytes_;  ///< null if not owned by the reader
  std::unique_ptr<File> file_;
  SensorSize size_;
  bool has_labels_ = false;
  std::unique_ptr<Hdf5Table> table_;
  std::unique_ptr<Hdf5Triggers> triggers_;
  RowValidator validator_;
  Corruption corruption_;

  std::uint64_t row_ = 0;              ///< next row to read
  std::vector<AbsoluteEvent> events_;  ///< read; the first returned_ were returned
  std::size_t returned_ = 0;
  std::optional<Microseconds> not_before_;  ///< time of a seek, until its first event is found
};

/// Creates a decoder for HDF5 files. A pushed file is collected in memory, up to 256 MiB, and read
/// at its end, because HDF5 needs random access.
std::unique_ptr<Decoder> make_hdf5_decoder(Hdf5Selection selection = {});

}  // namespace eventcamera
