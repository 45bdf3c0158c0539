// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/byte_cursor.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/ros/bag_file.hpp"

namespace eventcamera {

/// Reads the fields of a serialized message. Past the end everything is 0 or empty.
class MessageCursor {
 public:
  MessageCursor(std::span<const std::uint8_t> message, RosSerialization serialization)
      : MessageCursor(ByteCursor(message), serialization) {}

  bool failed() const { return failed_ || fields_.failed(); }

  template <class Number>
  Number number() {
    if (is_cdr_) fields_.align(sizeof(Number));
    return fields_.number<Number>();
  }

  bool boolean() { return number<std::uint8_t>() != 0; }

  /// Reads 32-bit seconds and nanoseconds; returns nanoseconds.
  std::uint64_t time() {
    const std::uint64_t seconds = number<std::uint32_t>();
    return seconds * 1'000'000'000 + number<std::uint32_t>();
  }

  /// In CDR, its size includes a final zero.
  std::string_view text() {
    if (is_cdr_) fields_.align(sizeof(std::uint32_t));
    auto text = fields_.text();
    if (is_cdr_ && text.ends_with('\0')) text.remove_suffix(1);
    return text;
  }

  std::span<const std::uint8_t> bytes() {
    if (is_cdr_) fields_.align(sizeof(std::uint32_t));
    return fields_.sized_bytes<std::uint32_t>();
  }

  /// Time of a std_msgs/Header, in nanoseconds.
  std::uint64_t header_stamp() {
    if (!is_cdr_) number<std::uint32_t>();  // its number
    const auto stamp = time();
    text();  // its frame
    return stamp;
  }

  std::span<const std::uint8_t> rest() const { return fields_.rest(); }

 private:
  MessageCursor(ByteCursor message, RosSerialization serialization)
      : is_cdr_(serialization == RosSerialization::cdr),
        failed_(is_cdr_ && !skip_encapsulation(message)),
        fields_(message.rest()) {}

  /// False unless little-endian XCDR1 follows.
  static bool skip_encapsulation(ByteCursor& message) {
    constexpr std::uint16_t little_endian_cdr = 0x0100;
    const auto scheme = message.number<std::uint16_t>();
    message.number<std::uint16_t>();  // options
    return !message.failed() && scheme == little_endian_cdr;
  }

  bool is_cdr_;
  bool failed_;
  ByteCursor fields_;
};

/// Decodes the messages of one topic. Times are ROS times: the stamps of the headers.
class TopicDecoder {
 public:
  virtual ~TopicDecoder() = default;
  TopicDecoder(const TopicDecoder&) = delete;
  TopicDecoder& operator=(const TopicDecoder&) = delete;

  /// Begins a message, whose bytes must stay valid until next() returns false. Notes corruption.
  /// Throws UnsupportedFormat.
  virtual void begin(const BagMessage& message) = 0;

  /// Decodes the next part of the message; false if there is none.
  virtual bool next() = 0;

  /// Forgets the messages so far, for a seek; the offset between clocks stays.
  virtual void restart() {}

  /// Part decoded by next().
  const Decoded& decoded() const { return decoded_; }
  const std::optional<Frame>& frame() const { return frame_; }

  /// Sensor size that the messages state; 0x0 if unknown.
  SensorSize size() const { return size_; }

  /// Offset from the sensor's clock to the ROS clock, nanoseconds; nothing if they are the same,
  /// or before the first message. It is kept until the camera is started again.
  virtual std::optional<std::uint64_t> clock_offset() const { return std::nullopt; }
  virtual void set_clock_offset(std::uint64_t /*offset*/) {}

 protected:
  explicit TopicDecoder(Corruption& corruption) : corruption_(corruption) {}

  /// Sets the size that the first message states, if it is valid. Later messages change nothing:
  /// the events before them might not fit.
  void set_size(std::uint32_t width, std::uint32_t height);

  Corruption& corruption_;
  Decoded decoded_;
  std::optional<Frame> frame_;
  SensorSize size_;

 private:
  bool size_known_ = false;
};

/// Content of the messages of a type; `other` if it is not decoded.
StreamKind kind_of_messages(const BagTopic& topic);

/// Creates the decoder for a topic with events or frames. `corruption` must outlive it.
std::unique_ptr<TopicDecoder> make_topic_decoder(const BagTopic& topic, Corruption& corruption);

/// event_camera_msgs/EventPacket, formerly event_array_msgs/EventArray: encoded events.
std::unique_ptr<TopicDecoder> make_event_packet_decoder(const BagTopic& topic,
                                                        Corruption& corruption);

}  // namespace eventcamera
