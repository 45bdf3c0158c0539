// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/ros/topic_decoder.hpp"

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/sensor_sizes.hpp"

namespace eventcamera {

namespace {

/// dvs_msgs/EventArray, and prophesee_event_msgs/EventArray, which is the same. Layout: dvs_msgs
/// (github.com/uzh-rpg/rpg_dvs_ros): header, height, width, and events of x and y, 16 bits each,
/// the time, and the polarity, a byte.
class EventArrayDecoder final : public TopicDecoder {
 public:
  EventArrayDecoder(const BagTopic& topic, Corruption& corruption)
      : TopicDecoder(corruption), serialization_(*topic.serialization) {}

  void begin(const BagMessage& message) override {
    fields_.emplace(message.bytes, serialization_);
    position_ = message.position;
    fields_->header_stamp();
    const auto height = fields_->number<std::uint32_t>();
    const auto width = fields_->number<std::uint32_t>();
    left_ = fields_->number<std::uint32_t>();
    if (!fields_->failed()) set_size(width, height);
  }

  bool next() override {
    constexpr std::uint32_t max_events = 4096;
    decoded_.events.clear();
    const auto count = std::min(left_, max_events);
    for (std::uint32_t i = 0; i < count && !fields_->failed(); ++i) append();
    left_ -= count;
    if (count > 0 && fields_->failed()) {
      corruption_.note(position_, "an array of events with missing bytes");
      left_ = 0;
    }
    if (size_ != SensorSize{})
      corruption_.outside += std::erase_if(decoded_.events, is_outside(size_));
    return count > 0;
  }

  void restart() override { left_ = 0; }

 private:
  void append() {
    const auto x = fields_->number<std::uint16_t>();
    const auto y = fields_->number<std::uint16_t>();
    const auto t = fields_->time();
    const auto polarity = fields_->boolean() ? Polarity::on : Polarity::off;
    if (fields_->failed()) return;
    if (y > 0x7fff)
      ++corruption_.outside;
    else
      decoded_.events.push_back(
          AbsoluteEvent::at(x, y, static_cast<Microseconds>(t / 1000), polarity));
  }

  RosSerialization serialization_;
  std::optional<MessageCursor> fields_;
  std::uint64_t position_ = 0;
  std::uint32_t left_ = 0;  ///< events not yet read, as stated in the message
};

/// An encoding of sensor_msgs/Image (include/sensor_msgs/image_encodings.h).
struct ImageEncoding {
  std::string_view name;
  PixelFormat format;
  bool is_rgb = false;  ///< red and blue must be swapped
};
constexpr ImageEncoding encodings[] = {
    {"mono8", PixelFormat::grey8},      {"8UC1", PixelFormat::grey8},
    {"mono16", PixelFormat::grey16},    {"16UC1", PixelFormat::grey16},
    {"bgr8", PixelFormat::bgr},         {"8UC3", PixelFormat::bgr},
    {"rgb8", PixelFormat::bgr, true},   {"bgra8", PixelFormat::bgra},
    {"rgba8", PixelFormat::bgra, true},
};

class ImageDecoder final : public TopicDecoder {
 public:
  ImageDecoder(const BagTopic& topic, Corruption& corruption)
      : TopicDecoder(corruption), serialization_(*topic.serialization) {}

  void begin(const BagMessage& message) override {
    MessageCursor fields(message.bytes, serialization_);
    if (const char* const problem = read(fields)) corruption_.note(message.position, problem);
  }

  /// The one part of a message is its frame.
  bool next() override {
    frame_.reset();
    std::swap(frame_, due_);
    return frame_.has_value();
  }

  void restart() override { due_.reset(); }

 private:
  /// Returns the fault of a message, or nullptr.
  const char* read(MessageCursor& fields) {
    Frame frame;
    frame.t = static_cast<Microseconds>(fields.header_stamp() / 1000);
    frame.begin = frame.end = frame.exposure_begin = frame.exposure_end = frame.t;
    const auto height = fields.number<std::uint32_t>();
    const auto width = fields.number<std::uint32_t>();
    const auto name = fields.text();
    const bool is_big_endian = fields.boolean();
    const std::size_t stride = fields.number<std::uint32_t>();
    const auto pixels = fields.bytes();
    if (fields.failed()) return "an image with missing bytes";
    const auto* const encoding = std::ranges::find(encodings, name, &ImageEncoding::name);
    if (encoding == std::end(encodings) ||
        (is_big_endian && encoding->format == PixelFormat::grey16))
      return "an image in an encoding that is not supported";
    if (!is_side(width) || !is_side(height) ||
        stride < width * static_cast<std::size_t>(bytes_per_pixel(encoding->format)) ||
        stride > pixels.size() / height)
      return "an image whose size does not match its pixels";
    set_size(width, height);
    frame.format = encoding->format;
    frame.width = static_cast<int>(width);
    frame.height = static_cast<int>(height);
    frame.stride = static_cast<std::ptrdiff_t>(stride);
    frame.pixels = encoding->is_rgb ? as_bgr(pixels, frame) : pixels.data();
    due_ = frame;
    return nullptr;
  }

  const std::uint8_t* as_bgr(std::span<const std::uint8_t> pixels, const Frame& frame) {
    const auto stride = static_cast<std::size_t>(frame.stride);
    const auto step = static_cast<std::size_t>(bytes_per_pixel(frame.format));
    bgr_.assign(pixels.begin(), pixels.begin() + frame.stride * frame.height);
    for (std::size_t y = 0; y < static_cast<std::size_t>(frame.height); ++y)
      for (std::size_t x = 0; x < static_cast<std::size_t>(frame.width); ++x)
        std::swap(bgr_[y * stride + x * step], bgr_[y * stride + x * step + 2]);
    return bgr_.data();
  }

  RosSerialization serialization_;
  std::optional<Frame> due_;
  std::vector<std::uint8_t> bgr_;
};

template <class Decoder>
std::unique_ptr<TopicDecoder> make(const BagTopic& topic, Corruption& corruption) {
  return std::make_unique<Decoder>(topic, corruption);
}

struct MessageType {
  std::string_view name;
  StreamKind kind;
  std::unique_ptr<TopicDecoder> (*make_decoder)(const BagTopic& topic, Corruption& corruption);
};
constexpr MessageType message_types[] = {
    {"event_camera_msgs/EventPacket", StreamKind::events, make_event_packet_decoder},
    {"event_array_msgs/EventArray", StreamKind::events, make_event_packet_decoder},
    {"dvs_msgs/EventArray", StreamKind::events, make<EventArrayDecoder>},
    {"prophesee_event_msgs/EventArray", StreamKind::events, make<EventArrayDecoder>},
    {"sensor_msgs/Image", StreamKind::frames, make<ImageDecoder>},
};

const MessageType* type_of(const BagTopic& topic) {
  for (const auto& type : message_types)
    if (topic.serialization && topic.type == type.name) return &type;
  return nullptr;
}

}  // namespace

StreamKind kind_of_messages(const BagTopic& topic) {
  const auto* const type = type_of(topic);
  return type != nullptr ? type->kind : StreamKind::other;
}

std::unique_ptr<TopicDecoder> make_topic_decoder(const BagTopic& topic, Corruption& corruption) {
  return type_of(topic)->make_decoder(topic, corruption);
}

void TopicDecoder::set_size(std::uint32_t width, std::uint32_t height) {
  if (!std::exchange(size_known_, true) && is_side(width) && is_side(height))
    size_ = {static_cast<int>(width), static_cast<int>(height)};
}

}  // namespace eventcamera
