// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>

#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Reads events and images from a ROS bag: MCAP, ROS 1 version 2.0, or ROS 2 with SQLite,
/// recognised by its first bytes.
///
/// Each topic that is read is a stream, named by StreamInfo::source. Times are the stamps of the
/// messages' headers, not the times at which they were recorded.
///
/// `topics`: names of the topics to read, separated by commas; empty: the first with events, and
/// all with images.
std::unique_ptr<Decoder> make_bag_decoder(std::string topics);

}  // namespace eventcamera
