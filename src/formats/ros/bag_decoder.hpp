// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "src/formats/decoder.hpp"
#include "src/formats/ros/bag_file.hpp"
#include "src/formats/ros/topic_decoder.hpp"

namespace eventcamera {

/// Reads events and images from a ROS bag: MCAP, ROS 1 version 2.0, or ROS 2 with SQLite,
/// recognised by its first bytes.
///
/// Each topic that is read is a stream, named by StreamInfo::source. Times are the stamps of the
/// messages' headers, not the times at which they were recorded.
class BagDecoder final : public Decoder {
 public:
  /// `topics`: names of the topics to read, separated by commas; empty: the first with events, and
  /// all with images.
  explicit BagDecoder(std::string topics);

  void push(std::span<const std::uint8_t> piece) override;
  void drain() override;
  bool open(ByteSource& source) override;
  std::optional<Item> next() override;
  const std::vector<StreamInfo>& streams() const override { return streams_; }
  const Corruption& corruption() const override;
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override;
  void restart(const SeekPoint& seek_point) override;
  std::optional<Microseconds> last_time() override;
  bool knows_all_streams() const override;
  std::optional<SeekPoint> first_of(std::size_t stream) const override;
  std::string format_name() const override { return format_name_; }
  UnreadStreams unread_streams() const override;

 private:
  void choose_format(std::span<const std::uint8_t> start);
  std::optional<std::size_t> add_topic(const BagTopic& topic);
  bool is_wanted(const BagTopic& topic, StreamKind kind) const;
  std::optional<Item> next_part();
  void learn_delay(Microseconds t);
  void require_topics() const;
  std::optional<Microseconds> decoded_last_time();

  std::string wanted_;  ///< with a comma before and after each name; empty: not chosen
  std::string format_name_;
  std::vector<std::uint8_t> start_;  ///< first bytes, until the format is known
  std::unique_ptr<BagFile> file_;    ///< null until then
  ByteSource* source_ = nullptr;     ///< set by open()
  std::vector<StreamInfo> streams_;
  std::vector<std::unique_ptr<TopicDecoder>> topics_;   ///< one a stream
  std::map<std::string, std::uint64_t> clock_offsets_;  ///< that topics begin with, by name
  std::vector<std::string> unread_;                     ///< names of topics with events or images
  std::vector<std::string> others_;                     ///< names of all other topics

  std::optional<std::size_t> decoding_;  ///< topic of the message being decoded
  bool events_due_ = false;              ///< its decoder has events to be returned
  Microseconds logged_ = 0;              ///< time of its recording
  std::optional<Microseconds> delay_;    ///< from the time of a message to its recording
  bool finished_ = false;
  bool last_time_due_ = true;  ///< last_time_ was not determined yet
  std::optional<Microseconds> last_time_;
};

}  // namespace eventcamera
