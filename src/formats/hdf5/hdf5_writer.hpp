// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include "src/formats/decoder.hpp"
#include "src/formats/hdf5/hdf5_layout.hpp"

namespace eventcamera {

/// Writes an HDF5 file of events. Every function throws std::runtime_error where the file cannot be
/// written, and std::invalid_argument where the layout cannot hold what it is given.
class Hdf5Writer {
 public:
  enum class Compression : std::uint8_t { none, gzip };

  struct Settings {
    Hdf5Layout layout = Hdf5Layout::dsec;         ///< dsec or metavision
    Compression compression = Compression::gzip;  ///< of DSEC; Metavision's is always ECF
    SensorSize size;
  };

  class Layout;

  /// Overwrites what is there.
  Hdf5Writer(const std::filesystem::path& path, const Settings& settings);
  /// Closes the file without an error; call close() to get it.
  ~Hdf5Writer();
  Hdf5Writer(const Hdf5Writer&) = delete;
  Hdf5Writer& operator=(const Hdf5Writer&) = delete;

  /// Events come sorted by time and within the sensor.
  void append(std::span<const AbsoluteEvent> events);

  /// Triggers are kept by Metavision's layout alone; DSEC has no place for them.
  void append(std::span<const Trigger> triggers);

  void close();

 private:
  struct File;

  SensorSize size_;
  std::unique_ptr<File> file_;
  std::unique_ptr<Layout> layout_;
  Microseconds latest_ = INT64_MIN;
};

}  // namespace eventcamera
