// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat4_elements.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "src/core/byte_order.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_flatbuffer.hpp"

namespace eventcamera {

namespace {

/// Elements returned at once; they fit into the L2 cache.
constexpr std::size_t block = 4096;

constexpr std::size_t event_size = sizeof(aedat4::Event);
static_assert(event_size == sizeof(AbsoluteEvent));

bool is_time(Microseconds t) {
  return t > -aedat4_last_time && t < aedat4_last_time;
}

/// Returns the event at `bytes`, without checking column and row.
AbsoluteEvent event_at(const std::uint8_t* bytes) {
  // t:64, x:16, y:16, on:8, padding:24
  const auto word = little_endian<std::uint64_t>(bytes + 8);
  const auto on = static_cast<std::uint16_t>(((word >> 32) & 0xff) != 0 ? 0x8000 : 0);
  return {little_endian<Microseconds>(bytes), static_cast<std::uint16_t>(word),
          static_cast<std::uint16_t>(((word >> 16) & 0x7fff) | on)};
}

int row_at(const std::uint8_t* bytes) {
  return little_endian<std::uint16_t>(bytes + 10);
}

/// Limit of valid coordinates; an unknown size gives the maximum.
SensorSize limit_of(SensorSize size) {
  return {size.width != 0 ? size.width : max_side, size.height != 0 ? size.height : max_side};
}

Trigger trigger_of(const aedat4::Trigger& trigger) {
  const auto source = static_cast<std::size_t>(static_cast<std::uint8_t>(trigger.source()));
  const auto edge =
      source < aedat4_edges.size() ? aedat4_edges[source] : Aedat4Edge{.id = 6, .rising = true};
  return {trigger.t(), edge.id, edge.rising};
}

ImuSample imu_sample_of(const aedat4::Imu& imu) {
  return {imu.t(),
          imu.temperature(),
          {imu.acceleration_x(), imu.acceleration_y(), imu.acceleration_z()},
          {imu.rotation_x(), imu.rotation_y(), imu.rotation_z()},
          {imu.magnetic_field_x(), imu.magnetic_field_y(), imu.magnetic_field_z()}};
}

}  // namespace

Aedat4Elements::Aedat4Elements(Corruption& corruption) : corruption_(corruption), events_(block) {
  triggers_.reserve(block);
}

void Aedat4Elements::clear() {
  count_ = 0;
  frame_.reset();
}

const char* Aedat4Elements::read(StreamKind kind, std::span<const std::uint8_t> content,
                                 std::uint64_t position) {
  if (kind == StreamKind::frames) return read_frame(content);
  std::optional<aedat4::Elements> elements = aedat4::Elements{};
  if (kind == StreamKind::events)
    elements = aedat4::verified_elements<aedat4::EventPacket>(content, "EVTS");
  else if (kind == StreamKind::triggers)
    elements = aedat4::verified_elements<aedat4::Tables<aedat4::Trigger>>(content, "TRIG");
  else if (kind == StreamKind::imu)
    elements = aedat4::verified_elements<aedat4::Tables<aedat4::Imu>>(content, "IMUS");
  if (!elements) return broken_packet;
  kind_ = kind;
  data_ = elements->data;
  count_ = elements->count;
  position_ = position;
  return nullptr;
}

const char* Aedat4Elements::read_frame(std::span<const std::uint8_t> content) {
  const auto* const packet = aedat4::verified<aedat4::Frame>(content, "FRME");
  if (packet == nullptr) return broken_packet;
  const auto format = static_cast<PixelFormat>(packet->format());
  const auto pixel = bytes_per_pixel(format);
  if (pixel == 0) return nullptr;  // an unknown format
  const auto pixels = aedat4::elements_of(packet->pixels());
  if (packet->width() <= 0 || packet->height() <= 0 ||
      pixels.count != std::size_t{1} * packet->width() * packet->height() * pixel)
    return "a frame whose payload does not match its dimensions";
  for (const auto t : {packet->t(), packet->begin_t(), packet->end_t(), packet->exposure_begin_t(),
                       packet->exposure_end_t(), packet->exposure()})
    if (!is_time(t)) return "a frame at an impossible time";
  Frame frame{packet->t(),
              packet->begin_t(),
              packet->end_t(),
              packet->exposure_begin_t(),
              packet->exposure_end_t(),
              format,
              packet->width(),
              packet->height(),
              packet->offset_x(),
              packet->offset_y(),
              pixels.data,
              std::ptrdiff_t{1} * packet->width() * pixel};
  // Newer files only have the time and the length of the exposure.
  if (frame.begin == 0 && frame.end == 0 && frame.exposure_begin == 0 && frame.exposure_end == 0) {
    frame.begin = frame.exposure_begin = frame.t;
    frame.end = frame.exposure_end = frame.t + packet->exposure();
  }
  frame_ = frame;
  return nullptr;
}

bool Aedat4Elements::are_sound_events(std::span<const std::uint8_t> content, SensorSize size) {
  const auto elements = aedat4::verified_elements<aedat4::EventPacket>(content, "EVTS");
  if (!elements) return true;
  const auto limit = limit_of(size);
  auto last = std::numeric_limits<Microseconds>::min();
  for (std::size_t i = 0; i < elements->count; ++i) {
    const auto* const bytes = elements->data + i * event_size;
    const auto event = event_at(bytes);
    if (event.x >= limit.width || row_at(bytes) >= limit.height || event.t < last ||
        !is_time(event.t) || little_endian<std::uint32_t>(bytes + 12) > 1)
      return false;
    last = event.t;
  }
  return true;
}

Item Aedat4Elements::next(std::size_t stream, SensorSize size) {
  if (frame_) return FrameItem{stream, *std::exchange(frame_, std::nullopt)};
  if (kind_ == StreamKind::events) return EventItem{stream, next_events(size)};
  if (kind_ == StreamKind::triggers) {
    read_tables(trigger_of, "a trigger at an impossible time", triggers_);
    return TriggerItem{stream, triggers_};
  }
  read_tables(imu_sample_of, "an IMU sample at an impossible time", imu_samples_);
  return ImuItem{stream, imu_samples_};
}

/// A valid block takes a single pass.
std::span<const AbsoluteEvent> Aedat4Elements::next_events(SensorSize size) {
  const auto count = std::min(count_, block);
  const auto* const from = data_;
  data_ += count * event_size;
  count_ -= count;
  const auto limit = limit_of(size);
  const auto width = limit.width;
  const auto height = limit.height;
  auto last = std::numeric_limits<Microseconds>::min();
  bool sound = true;
  for (std::size_t i = 0; i < count; ++i) {
    const auto* const bytes = from + i * event_size;
    const auto event = event_at(bytes);
    sound &= (event.x < width) & (row_at(bytes) < height) & (event.t >= last);
    last = event.t;
    events_[i] = event;
  }
  if (sound && is_time(events_[0].t) && is_time(last)) return {events_.data(), count};

  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const auto* const bytes = from + i * event_size;
    const auto event = event_at(bytes);
    if (!is_time(event.t)) {
      corruption_.note(position_, "an event at an impossible time");
    } else if (event.x >= width || row_at(bytes) >= height) {
      ++corruption_.outside;
    } else {
      events_[kept++] = event;
    }
  }
  return {events_.data(), kept};
}

/// Reads the next block of elements that are tables.
template <class Table, class Element>
void Aedat4Elements::read_tables(Element (*element_of)(const Table&), const char* corruption,
                                 std::vector<Element>& out) {
  const auto count = std::min(count_, block);
  const aedat4::Elements tables{data_, count};
  out.clear();
  for (std::size_t i = 0; i < count; ++i) {
    const auto* const table = tables.table<Table>(i);
    if (is_time(table->t()))
      out.push_back(element_of(*table));
    else
      corruption_.note(position_, corruption);
  }
  data_ += count * sizeof(flatbuffers::uoffset_t);
  count_ -= count;
}

}  // namespace eventcamera
