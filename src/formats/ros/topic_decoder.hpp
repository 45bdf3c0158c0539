// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/ros/bag_file.hpp"

namespace eventcamera {

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

}  // namespace eventcamera
