// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>

#include "src/core/event.hpp"
#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera {

class Hdf5Layout;

enum class Hdf5Format : std::uint8_t {
  dsec,        ///< datasets t, x, y and p of a group, with /ms_to_idx and /t_offset
  metavision,  ///< /CD/events and /EXT_TRIGGER/events, compressed with ECF
};

/// Compression of the DSEC layout.
enum class Hdf5Compression : std::uint8_t { none, gzip };

/// Writes events to an HDF5 file. All functions throw std::runtime_error if the file cannot be
/// written, and std::invalid_argument if the layout does not support the data.
///
/// Events appended before a commit() can be read even if the process is killed later. Without
/// commits, the same calls write the same bytes.
class Hdf5Writer {
 public:
  using Compression = Hdf5Compression;

  struct Settings {
    Hdf5Format format = Hdf5Format::dsec;
    Compression compression = Compression::gzip;  ///< for DSEC; Metavision always uses ECF
    SensorSize size;
    std::chrono::nanoseconds commit_interval = std::chrono::seconds{1};  ///< 0 = never
  };

  /// Overwrites an existing file.
  Hdf5Writer(const std::filesystem::path& path, const Settings& settings);
  /// Closes the file, ignoring errors; call close() to get them.
  ~Hdf5Writer();
  Hdf5Writer(const Hdf5Writer&) = delete;
  Hdf5Writer& operator=(const Hdf5Writer&) = delete;

  /// Events must be sorted by time and within the sensor. Starts a commit if the last one was
  /// `commit_interval` or a tenth of the events ago.
  void append(std::span<const AbsoluteEvent> events);

  /// Sets the labels of the next events to append, one each. The DSEC layout stores them as
  /// events/cause and events/class, with 0 for events without a label; Metavision drops them.
  /// Returns the number of stored labels.
  std::size_t label(std::span<const Label> labels);

  /// False for the DSEC layout, which has no triggers.
  bool append(std::span<const Trigger> triggers);

  void commit();
  void close();

 private:
  void start_commit(bool with_partial_chunks);

  using Clock = std::chrono::steady_clock;
  struct File;

  SensorSize size_;
  std::chrono::nanoseconds commit_interval_;
  std::unique_ptr<File> file_;
  std::unique_ptr<Hdf5Layout> layout_;
  Microseconds latest_ = INT64_MIN;
  std::optional<Clock::time_point> committed_;  ///< time of the last commit of all events
  std::size_t events_ = 0;
  std::size_t committed_events_ = 0;
};

}  // namespace eventcamera
