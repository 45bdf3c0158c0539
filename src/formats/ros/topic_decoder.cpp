// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/ros/topic_decoder.hpp"

#include <utility>

#include "src/core/max_side.hpp"

namespace eventcamera {

namespace {

struct MessageType {
  std::string_view name;
  StreamKind kind;
  std::unique_ptr<TopicDecoder> (*make_decoder)(const BagTopic& topic, Corruption& corruption);
};
constexpr MessageType message_types[] = {
    {"event_camera_msgs/EventPacket", StreamKind::events, make_event_packet_decoder},
    {"event_array_msgs/EventArray", StreamKind::events, make_event_packet_decoder},
    {"dvs_msgs/EventArray", StreamKind::events, make_event_array_decoder},
    {"prophesee_event_msgs/EventArray", StreamKind::events, make_event_array_decoder},
    {"sensor_msgs/Image", StreamKind::frames, make_image_decoder},
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
