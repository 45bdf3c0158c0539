// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "src/formats/byte_source.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// What a stream of a recording carries.
enum class StreamKind : std::uint8_t { events, frames, triggers, imu, other };

/// One of the streams of a recording.
struct StreamInfo {
  int id = 0;  ///< in the file
  StreamKind kind = StreamKind::other;
  SensorSize size;     ///< 0x0 where the file does not say
  std::string source;  ///< the camera's name
};

/// How the pixels of a frame are stored; the numbers are those of AEDAT4.
enum class PixelFormat : std::uint8_t { grey8 = 0, grey16 = 2, bgr = 16, bgra = 24 };

constexpr int bytes_per_pixel(PixelFormat format) {
  switch (format) {
    case PixelFormat::grey8:
      return 1;
    case PixelFormat::grey16:
      return 2;
    case PixelFormat::bgr:
      return 3;
    case PixelFormat::bgra:
      return 4;
  }
  return 0;
}

/// A picture that a camera took.
struct Frame {
  Microseconds t = 0;
  Microseconds begin = 0;
  Microseconds end = 0;
  Microseconds exposure_begin = 0;
  Microseconds exposure_end = 0;
  PixelFormat format = PixelFormat::grey8;
  int width = 0;
  int height = 0;
  int x = 0;  ///< of its left column on the sensor
  int y = 0;  ///< of its top row
  const std::uint8_t* pixels = nullptr;
  std::ptrdiff_t stride = 0;  ///< bytes from row to row
};

/// Some events of a stream. `stream` is an index into the reader's streams().
struct EventItem {
  std::size_t stream;
  std::span<const AbsoluteEvent> events;
};

/// A frame of a stream.
struct FrameItem {
  std::size_t stream;
  Frame frame;
};

/// Some triggers of a stream.
struct TriggerItem {
  std::size_t stream;
  std::span<const Trigger> triggers;
};

using Item = std::variant<EventItem, FrameItem, TriggerItem>;

/// Reads the items of a recording in the order of the file, whatever its format.
///
///     reader.push(piece);
///     while (const auto item = reader.next()) ...
class Reader {
 public:
  virtual ~Reader() = default;
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  /// Adds bytes, which stay borrowed until next() returns nothing; only then more may be pushed.
  virtual void push(std::span<const std::uint8_t> piece) = 0;

  /// Says that no more bytes come.
  virtual void finish() = 0;

  /// Gives access to all bytes of the file, for as long as the reader lives. True where the reader
  /// reads them itself from then on, and none are to be pushed.
  virtual bool open(ByteSource& /*source*/) { return false; }

  /// The next item, valid until the next call; nothing where that takes more bytes. Throws
  /// UnsupportedFormat.
  virtual std::optional<Item> next() = 0;

  /// The streams that are known so far.
  virtual const std::vector<StreamInfo>& streams() const = 0;

  virtual const Corruption& corruption() const = 0;

  /// Where to restart to get everything at `t` or later; nothing where a new reader has to begin
  /// at the start of the file.
  virtual std::optional<SeekPoint> seek_point_before(Microseconds t) const = 0;

  /// The next bytes are those at the position of this seek point.
  virtual void restart(const SeekPoint& seek_point) = 0;

  /// The time of the last event or frame, where the file tells it.
  virtual std::optional<Microseconds> last_time() { return std::nullopt; }

  /// Whether the file tells that a stream has no items.
  virtual bool is_empty(std::size_t /*stream*/) const { return false; }

  /// The name of the format, for a user; empty where it says no more than the media type.
  virtual std::string format_name() const { return {}; }

  /// How many samples of inertial sensors were left out.
  virtual std::uint64_t imu_samples() const { return 0; }

 protected:
  Reader() = default;
};

/// Reads a format that is one stream of events, and triggers, by its decoder.
class DecoderReader final : public Reader {
 public:
  explicit DecoderReader(std::unique_ptr<Decoder> decoder) : decoder_(std::move(decoder)) {
    streams_.front().size = decoder_->size();
  }

  void push(std::span<const std::uint8_t> piece) override { rest_ = piece; }
  void finish() override { finish_due_ = true; }
  std::optional<Item> next() override;
  const std::vector<StreamInfo>& streams() const override { return streams_; }
  const Corruption& corruption() const override { return decoder_->corruption(); }
  std::optional<SeekPoint> seek_point_before(Microseconds t) const override {
    return decoder_->seek_point_before(t);
  }
  void restart(const SeekPoint& seek_point) override;

 private:
  std::unique_ptr<Decoder> decoder_;
  std::vector<StreamInfo> streams_{{.id = 0, .kind = StreamKind::events, .size = {}, .source = {}}};
  std::span<const std::uint8_t> rest_;
  bool finish_due_ = false;
  Decoded decoded_;
  bool events_due_ = false;  ///< those in decoded_ are to be handed out
  bool triggers_due_ = false;
};

}  // namespace eventcamera
