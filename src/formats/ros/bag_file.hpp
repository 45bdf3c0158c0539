// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "src/core/event.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// How messages of a topic are serialized.
///
/// ros1: fields without padding (wiki.ros.org/msg,
/// wiki.ros.org/roscpp/Overview/MessagesSerialization). cdr: XCDR1 of OMG's DDS-XTypes 1.3,
/// section 7.4, little-endian, after an encapsulation header of four bytes, from which alignment
/// counts.
enum class RosSerialization : std::uint8_t { ros1, cdr };

struct BagTopic {
  std::string name;
  std::string type;                               ///< as in ROS 1: package/Type
  std::optional<RosSerialization> serialization;  ///< none: unknown
};

struct BagMessage {
  std::size_t topic;    ///< as BagFile::AddTopic returned it
  Microseconds logged;  ///< when it was recorded
  std::span<const std::uint8_t> bytes;
  std::uint64_t position;  ///< offset in the file, or of its chunk
};

/// Reads the messages of a bag, in the order of the file.
///
/// Bytes are passed in pieces, as to a Decoder; the split does not affect the result.
class BagFile {
 public:
  /// Called with every topic before its first message; returns a number for its messages, or
  /// nothing if they are not to be returned.
  using AddTopic = std::function<std::optional<std::size_t>(const BagTopic&)>;

  virtual ~BagFile() = default;
  BagFile(const BagFile&) = delete;
  BagFile& operator=(const BagFile&) = delete;

  virtual void push(std::span<const std::uint8_t> piece) = 0;
  virtual void finish() = 0;

  /// Gives access to all bytes; `source` must outlive this object. True if messages are read from
  /// it directly and no bytes must be pushed.
  virtual bool open(ByteSource& source) = 0;

  /// Returns the next message, valid until the next call; nothing if more bytes are needed. Throws
  /// UnsupportedFormat.
  virtual std::optional<BagMessage> next() = 0;

  /// Where to restart to get every message that was recorded at `logged` or later; nothing before
  /// the header is read.
  virtual std::optional<SeekPoint> seek_point_before(Microseconds logged) const = 0;

  virtual void restart(const SeekPoint& seek_point) = 0;

  /// Where to restart for the first message of a topic, if the file states it.
  virtual std::optional<SeekPoint> first_of(std::size_t topic) const = 0;

  /// Time of the last message, if the file states it.
  virtual std::optional<Microseconds> last_logged() const = 0;

  /// Corruption of the file, to which decoders add corrupt messages.
  Corruption& corruption() { return corruption_; }

 protected:
  explicit BagFile(AddTopic add_topic) : add_topic_(std::move(add_topic)) {}

  /// Limit of the name of a topic or type, bytes.
  static constexpr std::size_t max_name = 1024;

  /// `position`: of the record or row that states the topic.
  std::optional<std::size_t> add(const BagTopic& topic, std::uint64_t position) {
    if (std::max(topic.name.size(), topic.type.size()) <= max_name) return add_topic_(topic);
    corruption_.note(position, "a topic with an overlong name");
    return std::nullopt;
  }

  Corruption corruption_;

 private:
  AddTopic add_topic_;
};

/// Reads MCAP files, with and without chunks, summary and index.
std::unique_ptr<BagFile> make_mcap_file(BagFile::AddTopic add_topic);

/// Reads ROS 1 bags, version 2.0: wiki.ros.org/Bags/Format/2.0.
std::unique_ptr<BagFile> make_rosbag_file(BagFile::AddTopic add_topic);

/// Reads ROS 2 bags that are SQLite databases (github.com/ros2/rosbag2,
/// rosbag2_storage_sqlite3): the tables topics and messages, whose rows are in order of recording.
std::unique_ptr<BagFile> make_db3_file(BagFile::AddTopic add_topic);

/// Name of a message type without the folder that ROS 2 adds: package/Type of package/msg/Type.
inline std::string ros1_type(std::string type) {
  constexpr std::string_view folder = "/msg/";
  if (const auto at = type.find(folder); at != std::string::npos)
    type.replace(at, folder.size(), "/");
  return type;
}

}  // namespace eventcamera
