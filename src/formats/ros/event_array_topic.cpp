// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>

#include "src/formats/ros/topic_decoder.hpp"
#include "src/formats/sensor_sizes.hpp"

namespace eventcamera {

namespace {

/// Layout: dvs_msgs (github.com/uzh-rpg/rpg_dvs_ros): header, height, width, and events of x and y,
/// 16 bits each, the time, and the polarity, a byte.
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

}  // namespace

std::unique_ptr<TopicDecoder> make_event_array_decoder(const BagTopic& topic,
                                                       Corruption& corruption) {
  return std::make_unique<EventArrayDecoder>(topic, corruption);
}

}  // namespace eventcamera
