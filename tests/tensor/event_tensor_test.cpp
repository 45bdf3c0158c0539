// SPDX-License-Identifier: LGPL-2.1-or-later
// Tensors equal the plain reference, bit for bit, on every SIMD target of this processor.
#include "src/tensor/event_tensor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "src/tensor/tensor_elements.hpp"
#include "tests/core/targets.hpp"
#include "tests/reference/tensor.hpp"

namespace {

using namespace eventcamera;

constexpr Representation representations[] = {Representation::voxel_grid, Representation::histogram,
                                              Representation::time_surface,
                                              Representation::event_frame};
constexpr Normalization normalizations[] = {Normalization::none, Normalization::mean_std,
                                            Normalization::max};

/// Sorted, with several at a time.
std::vector<AbsoluteEvent> events_from(Microseconds start, std::size_t count, int width, int height,
                                       std::mt19937& random) {
  std::vector<AbsoluteEvent> events;
  const auto below = [&](int limit) {
    return static_cast<int>(random() % static_cast<unsigned>(limit));
  };
  for (std::size_t i = 0; i < count; ++i) {
    start += below(3) == 0 ? below(200) : 0;
    events.push_back(AbsoluteEvent::at(below(width), below(height), start,
                                       below(3) == 0 ? Polarity::off : Polarity::on));
  }
  return events;
}

template <class Element>
std::vector<Element> written(EventTensor& tensor, std::span<const AbsoluteEvent> events,
                             Microseconds end) {
  std::vector<Element> out(tensor.shape().elements());
  EXPECT_EQ(tensor.bytes(), out.size() * sizeof(Element));
  tensor.write(events, end, reinterpret_cast<std::byte*>(out.data()));
  return out;
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0;
}

/// Three windows, the second without events, the third overlapping the first.
void expect_reference(int width, int height, const TensorSettings& settings) {
  std::mt19937 random(7);
  const auto events = events_from(1'000'000'007, 400, width, height, random);
  const std::span all(events);
  EventTensor tensor(width, height, settings);
  for (const auto& [first, last] : {std::pair{0, 250}, {250, 250}, {200, 400}}) {
    const auto window =
        all.subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(last - first));
    const Microseconds end = events[static_cast<std::size_t>(last - 1)].t + 10;
    auto expected = reference::tensor(window, all.first(static_cast<std::size_t>(last)), end,
                                      tensor.shape(), settings)
                        .values;
    reference::normalize(expected, settings.normalization);
    EXPECT_TRUE(same_bits(written<float>(tensor, window, end), expected)) << width << "x" << height;
  }
}

TEST(EventTensor, EqualsTheReference) {
  targets::for_each([](const char* target) {
    SCOPED_TRACE(target);
    for (const auto representation : representations)
      for (const auto normalization : normalizations)
        for (const auto decay : {Decay::exponential, Decay::linear})
          for (const int bins : {1, 2, 5})
            for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {33, 5}, {64, 8}}) {
              SCOPED_TRACE(static_cast<int>(representation));
              expect_reference(width, height,
                               {.representation = representation,
                                .bins = bins,
                                .decay = decay,
                                .time_constant = 3000,
                                .normalization = normalization});
            }
  });
}

TEST(EventTensor, RemembersATimeSurfaceUntilReset) {
  EventTensor tensor(1, 1,
                     {.representation = Representation::time_surface,
                      .decay = Decay::linear,
                      .time_constant = 100});
  const std::vector events = {AbsoluteEvent::at(0, 0, 0, Polarity::on)};
  EXPECT_EQ(written<float>(tensor, events, 25), (std::vector<float>{0, 0.75F}));
  EXPECT_EQ(written<float>(tensor, {}, 50), (std::vector<float>{0, 0.5F}));
  EXPECT_EQ(written<float>(tensor, {}, 300), (std::vector<float>{0, 0}));
  written<float>(tensor, events, 0);
  tensor.reset();
  EXPECT_EQ(written<float>(tensor, {}, 10), (std::vector<float>{0, 0}));
}

/// What a byte of each representation means.
TEST(EventTensor, WritesBytes) {
  std::vector<AbsoluteEvent> events(300, AbsoluteEvent::at(0, 0, 0, Polarity::off));
  events.insert(events.end(), 3, AbsoluteEvent::at(1, 0, 0, Polarity::on));
  const auto bytes = [&](Representation representation, Normalization normalization) {
    EventTensor tensor(3, 1,
                       {.representation = representation,
                        .bins = 1,
                        .normalization = normalization,
                        .type = ElementType::uint8});
    return written<std::uint8_t>(tensor, events, 0);
  };
  using Bytes = std::vector<std::uint8_t>;
  EXPECT_EQ(bytes(Representation::histogram, Normalization::none), (Bytes{255, 0, 0, 0, 3, 0}));
  EXPECT_EQ(bytes(Representation::histogram, Normalization::max), (Bytes{255, 0, 0, 0, 3, 0}));
  EXPECT_EQ(bytes(Representation::event_frame, Normalization::none), (Bytes{0, 131, 128}));
  EXPECT_EQ(bytes(Representation::event_frame, Normalization::max), (Bytes{1, 129, 128}));
  EXPECT_EQ(bytes(Representation::voxel_grid, Normalization::mean_std), (Bytes{96, 160, 128}));
  EXPECT_EQ(bytes(Representation::time_surface, Normalization::none),
            (Bytes{255, 0, 0, 0, 255, 0}));
}

/// All that a half-precision number can be, what lies halfway between two, and beyond the largest.
std::vector<float> values_near_halves() {
  std::vector<float> values = {0.0F, -0.0F, 1e-9F, 65519.9F, 65520, 1e6F, -1e30F};
  for (int bits = 0; bits < 0x7c00; bits += 7) {
    const auto value = static_cast<float>(reference::value_of_half(bits));
    const auto middle = static_cast<float>(
        (reference::value_of_half(bits) + reference::value_of_half(std::min(bits + 1, 0x7bff))) /
        2);
    for (const float near :
         {value, middle, std::nextafter(middle, 1e9F), std::nextafter(middle, 0.0F)})
      values.insert(values.end(), {near, -near});
  }
  return values;
}

TEST(TensorElements, RoundsToHalfPrecision) {
  const auto values = values_near_halves();
  targets::for_each([&](const char* target) {
    std::vector<std::uint16_t> halves(values.size());
    write_float16(values, halves.data());
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double half = reference::value_of_half(halves[i]);
      ASSERT_EQ(half, reference::nearest_half(values[i])) << target << " " << values[i];
      ASSERT_EQ(std::signbit(half), std::signbit(values[i])) << target << " " << values[i];
    }
  });
}

TEST(TensorElements, RoundsToBytes) {
  std::mt19937 random(3);
  std::vector<float> values = {0.5F, 1.5F, 2.5F, -0.5F, 254.5F, 255.5F, 1e30F, -1e30F};
  std::normal_distribution<float> values_near_bytes(0, 200);
  while (values.size() < 1003) values.push_back(values_near_bytes(random));
  targets::for_each([&](const char* target) {
    for (const ByteScale scale : {ByteScale{1, 0}, {1, 128}, {32, 128}, {255, 0}})
      for (const std::size_t count : {std::size_t{1}, std::size_t{17}, values.size()}) {
        std::vector<std::uint8_t> bytes(count + 1, 77);
        write_uint8(std::span(values).first(count), scale, bytes.data());
        EXPECT_EQ(bytes.back(), 77) << target;
        for (std::size_t i = 0; i < count; ++i)
          ASSERT_EQ(bytes[i], reference::byte_of(values[i], scale.steps, scale.zero))
              << target << " " << values[i];
      }
  });
}

}  // namespace
