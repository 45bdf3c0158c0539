// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/hdf5/hdf5_format.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

/// Throws std::runtime_error if a call of the library failed.
void require(bool succeeded);

Hdf5Handle make_group(hid_t file, const char* name);

/// Creates the properties of a dataset, without modification times.
Hdf5Handle make_creation();

/// Dataset to which rows are appended.
class GrowingDataset {
 public:
  GrowingDataset(hid_t parent, const char* name, hid_t stored, hid_t memory, hsize_t chunk,
                 Hdf5Compression compression, int filter = 0);

  void append(const void* rows, hsize_t count);

  /// Writes a filtered chunk of `count` rows, the last ones of the dataset, from `begin` on.
  void write_chunk(std::span<const std::uint8_t> chunk, hsize_t begin, hsize_t count);

  void read(hsize_t first, hsize_t count, void* rows) const;

  hid_t id() const { return dataset_.get(); }
  hsize_t rows() const { return rows_; }

 private:
  void extend(hsize_t count);
  Hdf5Handle select(hsize_t first, hsize_t count) const;

  Hdf5Handle dataset_;
  hid_t memory_;
  hsize_t rows_ = 0;
};

/// Buffers rows until a chunk is full, or they are flushed.
template <class Row>
class BufferedDataset : public GrowingDataset {
 public:
  BufferedDataset(hid_t parent, const char* name, hid_t stored, hid_t memory, hsize_t chunk,
                  Hdf5Compression compression)
      : GrowingDataset(parent, name, stored, memory, chunk, compression), chunk_(chunk) {}

  void put(const Row& row) {
    buffer_.push_back(row);
    if (count() % chunk_ == 0) flush();
  }

  void flush() {
    append(buffer_.data(), buffer_.size());
    buffer_.clear();
  }

  /// Includes the rows in the buffer.
  hsize_t count() const { return rows() + buffer_.size(); }

 private:
  hsize_t chunk_;
  std::vector<Row> buffer_;
};

/// Rows per chunk. The index has small chunks, because each commit writes the last one.
constexpr hsize_t hdf5_chunk = 16384;
constexpr hsize_t hdf5_index_chunk = 4096;

/// Writes the datasets of one layout.
class Hdf5Layout {
 public:
  virtual ~Hdf5Layout() = default;
  virtual void append(std::span<const AbsoluteEvent> events) = 0;
  virtual bool append(std::span<const Trigger> triggers) = 0;
  virtual std::size_t label(std::span<const Label> /*labels*/) { return 0; }

  /// Passes rows to the library. Partial chunks are slow: the library compresses and writes them
  /// again when rows are added.
  virtual void flush(bool with_partial_chunks) = 0;
  virtual void close() = 0;
};

/// The layouts of DSEC, and of Metavision with ECF. Both throw std::runtime_error.
std::unique_ptr<Hdf5Layout> make_dsec_layout(hid_t file, SensorSize size,
                                             Hdf5Compression compression);
std::unique_ptr<Hdf5Layout> make_metavision_layout(hid_t file, SensorSize size);

/// Returns the time since the first event of a recording. Throws std::invalid_argument after a
/// week, because the index of both layouts grows with time, even without events.
inline Microseconds since(Microseconds first, Microseconds t) {
  constexpr Microseconds max_recording = 7LL * 24 * 3600 * 1'000'000;
  Microseconds passed = 0;
  if (__builtin_sub_overflow(t, first, &passed) || passed > max_recording)
    throw std::invalid_argument("an HDF5 recording cannot be longer than a week");
  return passed;
}

}  // namespace eventcamera
