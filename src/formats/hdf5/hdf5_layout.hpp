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
inline void require(bool succeeded) {
  if (!succeeded) throw std::runtime_error("the HDF5 library failed to write the file");
}

inline Hdf5Handle make_group(hid_t file, const char* name) {
  Hdf5Handle group(H5Gcreate2(file, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  require(static_cast<bool>(group));
  return group;
}

/// Creates the properties of a dataset, without modification times.
inline Hdf5Handle make_creation() {
  Hdf5Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  require(H5Pset_obj_track_times(creation.get(), false) >= 0);
  return creation;
}

/// Dataset to which rows are appended.
class GrowingDataset {
 public:
  GrowingDataset(hid_t parent, const char* name, hid_t stored, hid_t memory, hsize_t chunk,
                 Hdf5Compression compression, int filter = 0)
      : memory_(memory) {
    constexpr hsize_t none = 0;
    constexpr hsize_t no_limit = H5S_UNLIMITED;
    constexpr unsigned level = 1;  // the fastest; others hardly make events smaller
    const Hdf5Handle space(H5Screate_simple(1, &none, &no_limit), H5Sclose);
    const auto creation = make_creation();
    require(H5Pset_chunk(creation.get(), 1, &chunk) >= 0);
    if (compression == Hdf5Compression::gzip)
      require(H5Pset_shuffle(creation.get()) >= 0 && H5Pset_deflate(creation.get(), level) >= 0);
    if (filter != 0)
      require(H5Pset_filter(creation.get(), filter, H5Z_FLAG_OPTIONAL, 0, nullptr) >= 0);
    dataset_ = {
        H5Dcreate2(parent, name, stored, space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT),
        H5Dclose};
    require(static_cast<bool>(dataset_));
  }

  void append(const void* rows, hsize_t count) {
    if (count == 0) return;
    const auto begin = rows_;
    extend(count);
    const auto space = select(begin, count);
    const Hdf5Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
    require(H5Dwrite(dataset_.get(), memory_, memory.get(), space.get(), H5P_DEFAULT, rows) >= 0);
  }

  /// Writes a filtered chunk of `count` rows, the last ones of the dataset, from `begin` on.
  void write_chunk(std::span<const std::uint8_t> chunk, hsize_t begin, hsize_t count) {
    extend(begin + count - rows_);
    require(H5Dwrite_chunk(dataset_.get(), H5P_DEFAULT, 0, &begin, chunk.size(), chunk.data()) >=
            0);
  }

  void read(hsize_t first, hsize_t count, void* rows) const {
    const auto space = select(first, count);
    const Hdf5Handle memory(H5Screate_simple(1, &count, nullptr), H5Sclose);
    require(H5Dread(dataset_.get(), memory_, memory.get(), space.get(), H5P_DEFAULT, rows) >= 0);
  }

  hid_t id() const { return dataset_.get(); }
  hsize_t rows() const { return rows_; }

 private:
  void extend(hsize_t count) {
    rows_ += count;
    require(H5Dset_extent(dataset_.get(), &rows_) >= 0);
  }

  Hdf5Handle select(hsize_t first, hsize_t count) const {
    Hdf5Handle space(H5Dget_space(dataset_.get()), H5Sclose);
    require(H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, &first, nullptr, &count, nullptr) >=
            0);
    return space;
  }

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
