// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat4_encoder.hpp"

#include <algorithm>
#include <cstring>
#include <new>
#include <stdexcept>
#include <utility>

#include "src/core/sensor_size.hpp"
#include "src/formats/aedat/aedat4.fbs.h"

namespace eventcamera {

namespace {

constexpr std::size_t max_events = 4096;

}  // namespace

/// FlatBufferBuilder is a class or an alias, depending on the version of FlatBuffers.
class Aedat4Builder : public flatbuffers::FlatBufferBuilder {};

FrameCompressor make_aedat4_compressor(Aedat4Compression compression) {
  if (compression == Aedat4Compression::none) return FrameCompressor(std::nullopt);
  const bool is_high =
      compression == Aedat4Compression::lz4_high || compression == Aedat4Compression::zstd_high;
  return FrameCompressor(codec_of(compression),
                         is_high ? FrameCompressor::Level::high : FrameCompressor::Level::standard);
}

Aedat4Encoder::Aedat4Encoder(Aedat4Settings settings)
    : settings_(std::move(settings)),
      compressor_(make_aedat4_compressor(settings_.compression)),
      builder_(std::make_unique<Aedat4Builder>()) {
  if (!is_side(settings_.size.width) || !is_side(settings_.size.height))
    throw std::invalid_argument("AEDAT4 supports sensors of 1x1 to 16384x16384 pixels");
}

Aedat4Encoder::~Aedat4Encoder() = default;

void Aedat4Encoder::append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) {
  write_header(out);
  while (held_.size() + events.size() >= max_events) {
    // Full packets are written directly from `events`.
    const auto count = max_events - held_.size();
    if (held_.empty()) {
      write_events(events.first(count), out);
    } else {
      held_.insert(held_.end(), events.begin(),
                   events.begin() + static_cast<std::ptrdiff_t>(count));
      write_events(held_, out);
      held_.clear();
    }
    events = events.subspan(count);
  }
  held_.insert(held_.end(), events.begin(), events.end());
}

void Aedat4Encoder::encode(const Frame& frame, std::vector<std::uint8_t>& out) {
  if (!settings_.frames) throw std::invalid_argument("this AEDAT4 file has no frame stream");
  const auto row = static_cast<std::size_t>(frame.width) *
                   static_cast<std::size_t>(bytes_per_pixel(frame.format));
  if (!is_side(frame.width) || !is_side(frame.height) ||
      row * static_cast<std::size_t>(frame.height) > aedat4_max_packet / 2)
    throw std::invalid_argument("frame too large for AEDAT4");
  flush(out);
  builder_->Clear();
  std::uint8_t* pixels = nullptr;
  const auto vector =
      builder_->CreateUninitializedVector(row * static_cast<std::size_t>(frame.height), &pixels);
  for (int y = 0; y < frame.height; ++y)
    std::memcpy(pixels + static_cast<std::size_t>(y) * row, frame.pixels + y * frame.stride, row);
  builder_->FinishSizePrefixed(
      aedat4::CreateFrame(
          *builder_, frame.t, frame.begin, frame.end, frame.exposure_begin, frame.exposure_end,
          static_cast<std::int8_t>(frame.format), static_cast<std::int16_t>(frame.width),
          static_cast<std::int16_t>(frame.height), static_cast<std::int16_t>(frame.x),
          static_cast<std::int16_t>(frame.y), vector, frame.exposure_end - frame.exposure_begin),
      "FRME");
  write_packet(frame_stream, 1, frame.t, frame.t, out);
}

std::size_t Aedat4Encoder::encode(std::span<const Trigger> triggers,
                                  std::vector<std::uint8_t>& out) {
  if (!settings_.triggers) return 0;
  write_header(out);
  builder_->Clear();
  std::vector<flatbuffers::Offset<aedat4::Trigger>> elements;
  for (const auto& [t, id, rising] : triggers) {
    const auto edge = std::ranges::find(aedat4_edges, Aedat4Edge{id, rising});
    if (edge != aedat4_edges.end())
      elements.push_back(aedat4::CreateTrigger(
          *builder_, t, static_cast<std::int8_t>(edge - aedat4_edges.begin())));
  }
  if (elements.empty()) return 0;
  const auto vector = builder_->CreateVector(elements);
  builder_->FinishSizePrefixed(aedat4::CreateTriggerPacket(*builder_, vector), "TRIG");
  write_packet(trigger_stream, static_cast<std::int64_t>(elements.size()), triggers.front().t,
               triggers.back().t, out);
  return elements.size();
}

std::size_t Aedat4Encoder::encode(std::span<const ImuSample> samples,
                                  std::vector<std::uint8_t>& out) {
  if (!settings_.imu_samples || samples.empty()) return 0;
  write_header(out);
  builder_->Clear();
  std::vector<flatbuffers::Offset<aedat4::Imu>> elements;
  for (const auto& [t, temperature, a, r, m] : samples)
    elements.push_back(aedat4::CreateImu(*builder_, t, temperature, a[0], a[1], a[2], r[0], r[1],
                                         r[2], m[0], m[1], m[2]));
  const auto vector = builder_->CreateVector(elements);
  builder_->FinishSizePrefixed(aedat4::CreateImuPacket(*builder_, vector), "IMUS");
  write_packet(imu_stream, static_cast<std::int64_t>(elements.size()), samples.front().t,
               samples.back().t, out);
  return elements.size();
}

void Aedat4Encoder::flush(std::vector<std::uint8_t>& out) {
  write_header(out);
  if (held_.empty()) return;
  write_events(held_, out);
  held_.clear();
}

bool Aedat4Encoder::append_end(std::vector<std::uint8_t>& out) {
  flush(out);
  if (!settings_.table) return false;
  patch_.emplace(FilePatch{table_field_at_, std::vector<std::uint8_t>(sizeof position_)});
  std::memcpy(patch_->bytes.data(), &position_, sizeof position_);
  const auto at = out.size();
  compressor_.compress(aedat4_table_content(table_), out);
  position_ += out.size() - at;
  return false;
}

void Aedat4Encoder::write_header(std::vector<std::uint8_t>& out) {
  if (position_ != 0) return;
  std::vector<StreamInfo> streams{
      {event_stream, StreamKind::events, settings_.size, settings_.source}};
  const auto add = [&](bool is_written, int id, StreamKind kind) {
    if (is_written) streams.push_back({id, kind, settings_.size, settings_.source});
  };
  add(settings_.frames, frame_stream, StreamKind::frames);
  add(settings_.triggers, trigger_stream, StreamKind::triggers);
  add(settings_.imu_samples, imu_stream, StreamKind::imu);
  flatbuffers::FlatBufferBuilder builder;
  // Reserve space for the table's position, which is not known yet.
  builder.ForceDefaults(true);
  const auto info = builder.CreateString(write_info_node(streams, settings_.compression));
  builder.FinishSizePrefixed(
      aedat4::CreateHeader(builder, static_cast<int>(settings_.compression), -1, info), "IOHE");
  const std::span<const std::uint8_t> header(builder.GetBufferPointer(), builder.GetSize());
  const auto* const fields = reinterpret_cast<const flatbuffers::Table*>(
      flatbuffers::GetSizePrefixedRoot<aedat4::Header>(header.data()));
  table_field_at_ =
      aedat4_magic.size() +
      static_cast<std::size_t>(fields->GetAddressOf(aedat4::Header::VT_DATA_TABLE_POSITION) -
                               header.data());
  out.insert(out.end(), aedat4_magic.begin(), aedat4_magic.end());
  out.insert(out.end(), header.begin(), header.end());
  position_ = aedat4_magic.size() + header.size();
}

void Aedat4Encoder::write_events(std::span<const AbsoluteEvent> events,
                                 std::vector<std::uint8_t>& out) {
  builder_->Clear();
  aedat4::Event* to = nullptr;
  const auto vector =
      builder_->CreateUninitializedVectorOfStructs<aedat4::Event>(events.size(), &to);
  for (const auto& event : events)
    new (to++)
        aedat4::Event(event.t, static_cast<std::int16_t>(event.x),
                      static_cast<std::int16_t>(event.y()), event.polarity() == Polarity::on);
  builder_->FinishSizePrefixed(aedat4::CreateEventPacket(*builder_, vector), "EVTS");
  write_packet(event_stream, static_cast<std::int64_t>(events.size()), events.front().t,
               events.back().t, out);
}

/// Writes the content of the builder as a packet.
void Aedat4Encoder::write_packet(int stream, std::int64_t elements, Microseconds start,
                                 Microseconds end, std::vector<std::uint8_t>& out) {
  const auto at = out.size();
  out.resize(at + aedat4_packet_header);
  compressor_.compress({builder_->GetBufferPointer(), builder_->GetSize()}, out);
  const auto size = static_cast<std::int32_t>(out.size() - at - aedat4_packet_header);
  const std::int32_t header[] = {stream, size};
  std::memcpy(out.data() + at, header, sizeof header);
  if (settings_.table) table_.push_back({position_, stream, size, elements, start, end});
  position_ += out.size() - at;
}

}  // namespace eventcamera
