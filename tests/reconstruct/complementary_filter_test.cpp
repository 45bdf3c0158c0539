// SPDX-License-Identifier: LGPL-2.1-or-later
// ComplementaryFilter: compared with its equations.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "src/reconstruct/complementary_filter.hpp"

namespace {

using namespace eventcamera;

/// The equations of docs/reconstruction.md, of one pixel.
class Pixel {
 public:
  explicit Pixel(int grey) : state_(response(grey)), frame_(state_) {}

  void decay_to(double t, double cutoff) {
    state_ = frame_ + (state_ - frame_) * std::exp(-2 * std::numbers::pi * cutoff * (t - t_) / 1e6);
    t_ = t;
  }
  void add(double change) { state_ += change; }
  void set_frame(int grey) { frame_ = response(grey); }
  double grey() const { return std::clamp(std::exp(state_) - offset, 0., 255.); }

 private:
  static constexpr double offset = 12.75;

  static double response(int grey) { return std::log(grey + offset); }

  double t_ = 0;
  double state_;
  double frame_;
};

TEST(ComplementaryFilter, FollowsItsEquations) {
  std::minstd_rand random(3);
  const auto below = [&random](int n) {
    return static_cast<int>(random() % static_cast<unsigned>(n));
  };
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {33, 20}})
    for (const double cutoff : {0., 0.5, 20., 1000.}) {
      Image<std::uint8_t> frame(width, height);
      const auto draw_frame = [&, width = width, height = height] {
        for (int y = 0; y < height; ++y)
          for (int x = 0; x < width; ++x) frame.at(x, y) = static_cast<std::uint8_t>(below(256));
      };
      draw_frame();
      ComplementaryFilter::Settings settings{cutoff, 0.3, 0.1};
      ComplementaryFilter filter(frame.view(), 0, settings);
      std::vector<Pixel> pixels;
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) pixels.emplace_back(frame.at(x, y));
      Microseconds t = 0;
      for (int step = 0; step < 200; ++step, t += 1 + below(step % 9 == 0 ? 100'000 : 3'000)) {
        if (step == 100) settings = {cutoff / 2, 0.2, 0.25};
        for (Pixel& pixel : pixels) pixel.decay_to(static_cast<double>(t), settings.cutoff);
        filter.configure(settings);
        if (step % 20 == 19) {
          draw_frame();
          filter.set_frame(frame.view(), t);
          for (std::size_t i = 0; i < pixels.size(); ++i)
            pixels[i].set_frame(frame.at(static_cast<int>(i) % width, static_cast<int>(i) / width));
        }
        const int x = below(width);
        const int y = below(height);
        const bool rises = below(2) == 0;
        const Event event = Event::at(x, y, 0, rises ? Polarity::on : Polarity::off);
        EXPECT_EQ(filter.add({&event, 1}, t, 0).outside, 0U);
        pixels[static_cast<std::size_t>(y * width + x)].add(rises ? settings.positive_threshold
                                                                  : -settings.negative_threshold);
        Image<std::uint8_t> picture(width, height);
        filter.draw(t, reinterpret_cast<std::byte*>(picture.row(0)), picture.stride());
        for (std::size_t i = 0; i < pixels.size(); ++i)
          ASSERT_NEAR(picture.at(static_cast<int>(i) % width, static_cast<int>(i) / width),
                      pixels[i].grey(), 0.6)
              << cutoff << ' ' << step << ' ' << i;
      }
    }
}

/// Without events, a frame comes back as it is.
TEST(ComplementaryFilter, ShowsEveryGreyLevelOfAFrame) {
  Image<std::uint8_t> frame(256, 1);
  for (int x = 0; x < 256; ++x) frame.at(x, 0) = static_cast<std::uint8_t>(x);
  const ComplementaryFilter filter(frame.view(), 1000, {});
  std::vector<std::uint8_t> picture(256);
  filter.draw(900'000, reinterpret_cast<std::byte*>(picture.data()), 256);
  EXPECT_TRUE(std::ranges::equal(picture, std::span(frame.row(0), 256)));
}

}  // namespace
