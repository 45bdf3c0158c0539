// SPDX-License-Identifier: LGPL-2.1-or-later
// Every method equals its plain scalar reference, event for event: sizes down to one pixel, depths,
// strides, steps, thresholds, textures and noise, motion across the border, numbers of threads, and
// on every SIMD target of this processor.
#include <gtest/gtest.h>

#include <cstring>

#include "src/core/luma.hpp"
#include "src/flow/region_of_interest_flow.hpp"
#include "src/simulate/simulators.hpp"
#include "tests/core/targets.hpp"
#include "tests/reference/dense.hpp"
#include "tests/reference/diff.hpp"
#include "tests/reference/sparse.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

enum class Picture {
  noise,
  texture,  ///< seen by a moving camera
  patch,    ///< an object that moves in front of a static texture
};

struct Case {
  int width;
  int height;
  int bits;
  int interpolated_frames;
  Picture picture;
  int threads;
};

/// Image with garbage between its rows.
template <class Pixel>
class Padded {
 public:
  explicit Padded(const Image<Pixel>& picture)
      : stride_((picture.width() + 13) * static_cast<std::ptrdiff_t>(sizeof(Pixel))),
        bytes_(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(picture.height()),
               0xab),
        width_(picture.width()),
        height_(picture.height()) {
    for (int y = 0; y < height_; ++y)
      std::memcpy(bytes_.data() + y * stride_, picture.row(y),
                  static_cast<std::size_t>(width_) * sizeof(Pixel));
  }
  LumaView luma(int bits) const { return {{width_, height_, bits}, bytes_.data(), stride_}; }

 private:
  std::ptrdiff_t stride_;
  std::vector<std::uint8_t> bytes_;
  int width_;
  int height_;
};

template <class Pixel>
Image<std::uint8_t> grey8(const Image<Pixel>& picture, int bits) {
  Grey8 grey;
  Image<std::uint8_t> copy(picture.width(), picture.height());
  copy.assign(grey.of(scene::luma(picture.view(), bits)));
  return copy;
}

template <class Pixel>
Image<Pixel> picture_of(const Case& c, int i) {
  if (c.picture == Picture::noise) return scene::noise<Pixel>(c.width, c.height, c.bits, 7 + i);
  if (c.picture == Picture::texture)
    return scene::texture<Pixel>(c.width, c.height, c.bits, 2.6 * i, -1.3 * i);
  auto picture = scene::texture<Pixel>(c.width, c.height, c.bits, 0, 0);
  const auto patch = scene::noise<Pixel>(c.width / 4, c.height / 4, c.bits, 3);
  for (int y = 0; y < patch.height(); ++y)
    for (int x = 0; x < patch.width(); ++x)
      picture.at(c.width / 3 + 3 * i + x, c.height / 3 + i + y) = patch.at(x, y);
  return picture;
}

class Equality : public testing::TestWithParam<Case> {
 protected:
  template <class Pixel>
  void hold() {
    const auto c = GetParam();
    settings.interpolated_frames = c.interpolated_frames;
    settings.threads = c.threads;
    format = {c.width, c.height, c.bits};
    const StepTimes steps(scene::frame_time, c.interpolated_frames + 1);
    std::vector<Image<Pixel>> frames;
    for (int i = 0; i < 3; ++i) frames.push_back(picture_of<Pixel>(c, i));
    std::vector<Padded<Pixel>> padded(frames.begin(), frames.end());
    for (const auto& frame : padded) views.push_back(frame.luma(c.bits));
    const auto& last = frames[1];
    const auto& now = frames[2];

    settings.positive_threshold = 9;
    settings.negative_threshold = 14;
    const auto thresholds = Thresholds::of(settings, c.bits);
    check(*make_frame_simulator(format),
          reference::differences<Pixel>({last, now}, StepTimes(scene::frame_time, 1), thresholds));
    hold_sparse(last, now, steps, thresholds);
    hold_diff(frames, steps, thresholds);

    settings.positive_threshold = 2;
    settings.negative_threshold = 3;
    hold_dense(last, now, steps, Thresholds::of(settings, c.bits));
  }

 private:
  template <class Pixel>
  void hold_dense(const Image<Pixel>& last, const Image<Pixel>& now, const StepTimes& steps,
                  const Thresholds& thresholds) {
    for (const auto method : {FlowMethod::dis_lq, FlowMethod::dis_hq, FlowMethod::farneback}) {
      RegionOfInterestFlow finder(method, format.width, format.height);
      const auto from = grey8(last, format.bits);
      const auto to = grey8(now, format.bits);
      ThreadPool one;
      const auto changed =
          reference::changed_box(last, now, std::min(thresholds.positive, thresholds.negative));
      const auto flow = finder.find(from.view(), to.view(), changed, one);
      for (const auto interpolation : {Interpolation::forward, Interpolation::blend}) {
        SCOPED_TRACE(testing::Message() << "dense, flow " << static_cast<int>(method)
                                        << ", interpolation " << static_cast<int>(interpolation));
        const auto simulator = make_dense_simulator(format);
        simulator->set_flow(method);
        simulator->set_interpolation(interpolation);
        check(*simulator, reference::dense(last, now, flow, interpolation, steps, thresholds));
      }
    }
  }

  template <class Pixel>
  void hold_sparse(const Image<Pixel>& last, const Image<Pixel>& now, const StepTimes& steps,
                   const Thresholds& thresholds) {
    SCOPED_TRACE("sparse");
    const auto points =
        reference::changed(last, now, std::min(thresholds.positive, thresholds.negative));
    ThreadPool threads;
    PointTracker tracker(2);
    tracker.push(grey8(last, format.bits).view(), threads);
    tracker.push(grey8(now, format.bits).view(), threads);
    check(*make_sparse_simulator(format),
          reference::sparse(last, now, points, tracker.track(points, threads), steps, thresholds));
  }

  template <class Pixel>
  void hold_diff(const std::vector<Image<Pixel>>& frames, const StepTimes& steps,
                 const Thresholds& thresholds) {
    SCOPED_TRACE("diff");
    const auto before = reference::difference_frame(frames[0], frames[1], thresholds);
    const auto now = reference::difference_frame(frames[1], frames[2], thresholds);
    const auto follow = [&](int sign) {
      const auto from = reference::part_of(before, sign, format.bits);
      const auto to = reference::part_of(now, sign, format.bits);
      ThreadPool threads;
      PointTracker tracker(1);
      tracker.push(from.view(), threads);
      tracker.push(to.view(), threads);
      reference::Tracked tracked{reference::points_of(from), {}};
      const auto tracks = tracker.track(tracked.points, threads);
      tracked.tracks.assign(tracks.begin(), tracks.end());
      return tracked;
    };
    check(*make_diff_simulator(format), reference::diff(before, now, follow(1), follow(-1), steps));
  }

  void check(Simulator& simulator, const std::vector<Event>& expected) {
    targets::for_each([&](const char* target) {
      const auto events = scene::last_interval(simulator, settings, views);
      EXPECT_TRUE(scene::sorted(events));
      EXPECT_TRUE(events == expected)
          << events.size() << " events instead of " << expected.size() << " on " << target;
    });
  }

  Settings settings;
  LumaFormat format;
  std::vector<LumaView> views;
};

TEST_P(Equality, WithTheReference) {
  if (GetParam().bits > 8)
    hold<std::uint16_t>();
  else
    hold<std::uint8_t>();
}

INSTANTIATE_TEST_SUITE_P(
    Small, Equality,
    testing::Values(Case{1, 1, 8, 10, Picture::noise, 1}, Case{1, 9, 8, 10, Picture::noise, 1},
                    Case{9, 1, 8, 10, Picture::noise, 1}, Case{2, 3, 16, 4, Picture::noise, 2},
                    Case{17, 5, 8, 0, Picture::noise, 2}, Case{15, 16, 8, 1, Picture::noise, 1},
                    Case{16, 17, 10, 10, Picture::noise, 2},
                    Case{65, 33, 8, 10, Picture::noise, 1}));
INSTANTIATE_TEST_SUITE_P(Textures, Equality,
                         testing::Values(Case{97, 61, 8, 10, Picture::texture, 1},
                                         Case{97, 61, 8, 10, Picture::texture, 2},
                                         Case{128, 64, 8, 20, Picture::texture, 2},
                                         Case{131, 50, 16, 10, Picture::texture, 2},
                                         Case{90, 70, 12, 3, Picture::texture, 1},
                                         Case{75, 49, 8, 255, Picture::texture, 2},
                                         Case{160, 120, 8, 10, Picture::texture, 2}));
INSTANTIATE_TEST_SUITE_P(StillGrounds, Equality,
                         testing::Values(Case{200, 150, 8, 10, Picture::patch, 2},
                                         Case{333, 101, 8, 20, Picture::patch, 1},
                                         Case{120, 90, 16, 10, Picture::patch, 2}));

}  // namespace
