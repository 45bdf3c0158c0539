// SPDX-License-Identifier: LGPL-2.1-or-later
// The kinds of topics that make_topic_decoder() chooses from.
#pragma once

#include <memory>

#include "src/formats/ros/topic_decoder.hpp"

namespace eventcamera {

/// event_camera_msgs/EventPacket, formerly event_array_msgs/EventArray: encoded events.
std::unique_ptr<TopicDecoder> make_event_packet_decoder(const BagTopic& topic,
                                                        Corruption& corruption);

/// dvs_msgs/EventArray, and prophesee_event_msgs/EventArray, which is the same: a list of events.
std::unique_ptr<TopicDecoder> make_event_array_decoder(const BagTopic& topic,
                                                       Corruption& corruption);

/// sensor_msgs/Image.
std::unique_ptr<TopicDecoder> make_image_decoder(const BagTopic& topic, Corruption& corruption);

}  // namespace eventcamera
