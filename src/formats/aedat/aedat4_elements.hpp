// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Elements of an AEDAT4 packet: events, triggers, IMU samples or a frame. Checks the packet, then
/// returns its elements in blocks, without invalid ones.
class Aedat4Elements {
 public:
  static constexpr const char* broken_packet = "a packet whose FlatBuffer is corrupt";

  explicit Aedat4Elements(Corruption& corruption);

  /// Reads a packet at `position`, whose FlatBuffer `content` must stay valid until all elements
  /// were returned. Returns a description of its corruption, or nullptr.
  const char* read(StreamKind kind, std::span<const std::uint8_t> content, std::uint64_t position);

  /// True once all elements were returned.
  bool empty() const { return count_ == 0 && !frame_; }

  /// Returns the next elements as items of `stream`, whose sensor has this size.
  Item next(std::size_t stream, SensorSize size);

  /// Drops the rest of the packet.
  void clear();

  /// True if all events of a packet are valid and in order, and for all other packets.
  static bool are_sound_events(std::span<const std::uint8_t> content, SensorSize size);

 private:
  const char* read_frame(std::span<const std::uint8_t> content);
  std::span<const AbsoluteEvent> next_events(SensorSize size);
  template <class Table, class Element>
  void read_tables(Element (*element_of)(const Table&), const char* corruption,
                   std::vector<Element>& out);

  Corruption& corruption_;
  StreamKind kind_ = StreamKind::other;
  const std::uint8_t* data_ = nullptr;  ///< elements not returned yet
  std::size_t count_ = 0;               ///< their number
  std::uint64_t position_ = 0;
  std::optional<Frame> frame_;
  std::vector<AbsoluteEvent> events_;
  std::vector<Trigger> triggers_;
  std::vector<ImuSample> imu_samples_;
};

}  // namespace eventcamera
