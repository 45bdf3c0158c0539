// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "src/formats/collected_bytes.hpp"
#include "src/formats/compression/compressed_frames.hpp"
#include "src/formats/ros/bag_file.hpp"

namespace eventcamera {

class SqliteDatabase;
class SqliteRows;

/// Reads ROS 2 bags that are SQLite databases (github.com/ros2/rosbag2,
/// rosbag2_storage_sqlite3): the tables topics and messages, whose rows are in the order of their
/// recording. A pushed file is collected in memory, up to 256 MiB, and read at its end, because
/// databases need random access. The position of a seek point is the ID of a message.
class Db3File final : public BagFile {
 public:
  explicit Db3File(AddTopic add_topic);
  ~Db3File() override;
  Db3File(const Db3File&) = delete;
  Db3File& operator=(const Db3File&) = delete;

  void push(std::span<const std::uint8_t> piece) override { collected_.push(piece); }
  void finish() override;
  bool open(ByteSource& source) override;
  std::optional<BagMessage> next() override;
  std::optional<SeekPoint> seek_point_before(Microseconds logged) const override;
  void restart(const SeekPoint& seek_point) override;
  std::optional<SeekPoint> first_of(std::size_t topic) const override;
  std::optional<Microseconds> last_logged() const override { return last_logged_; }

 private:
  void read_topics();
  void read_from(std::int64_t id);
  std::optional<std::span<const std::uint8_t>> content_of(std::span<const std::uint8_t> data);

  CollectedBytes collected_{"a .db3 file"};  ///< in push mode
  std::unique_ptr<ByteSource> own_bytes_;    ///< the same, at the end
  std::unique_ptr<SqliteDatabase> database_;
  std::unique_ptr<SqliteRows> messages_;  ///< those not yet read
  bool is_opened_ = false;                ///< with random access
  std::map<std::int64_t, std::optional<std::size_t>> topics_;
  std::optional<Microseconds> last_logged_;
  std::optional<std::int64_t> last_read_;  ///< ID of the last message: they rise
  std::int64_t first_id_ = 0;
  std::int64_t last_id_ = 0;
  FrameDecompressor decompressor_;
};

}  // namespace eventcamera
