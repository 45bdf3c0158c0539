// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <span>
#include <stdexcept>

#include "src/core/event.hpp"
#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/hdf5/hdf5_format.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

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

  /// Passes rows to the library. Partial chunks cost time: the library compresses and writes them
  /// again once they have more rows.
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
