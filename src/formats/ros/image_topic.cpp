// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <string_view>
#include <vector>

#include "src/core/max_side.hpp"
#include "src/formats/ros/topic_decoder.hpp"

namespace eventcamera {

namespace {

/// An encoding of sensor_msgs/Image (include/sensor_msgs/image_encodings.h).
struct ImageEncoding {
  std::string_view name;
  PixelFormat format;
  bool is_rgb = false;  ///< red is to change places with blue
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

}  // namespace

std::unique_ptr<TopicDecoder> make_image_decoder(const BagTopic& topic, Corruption& corruption) {
  return std::make_unique<ImageDecoder>(topic, corruption);
}

}  // namespace eventcamera
