// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/scenes.hpp"

#include <gst/app/gstappsink.h>
#include <gst/gst.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <utility>

#include "tests/simulate/scene.hpp"

namespace bench {
namespace {

/// Frames first ... first + count - 1 of a video.
struct Span {
  int first;
  int count;
};

struct Video {
  std::string name;
  std::string file;
  std::vector<Span> spans;  ///< in order
  int width;
  int height;
  int interpolated_frames;
};

Video driving_video(int width, int height) {
  return {"driving-" + std::to_string(width) + "x" + std::to_string(height),
          "driving-1280x720-25fps.mp4",
          {{0, 4}, {34, 4}},
          width,
          height,
          20};
}

/// Visits the first `count` frames of a file, in grey, scaled to a width (a multiple of 4) and
/// height. Returns how many there were.
template <class Visit>
int for_each_frame(const std::string& path, int count, int width, int height, const Visit& visit) {
  gst_init(nullptr, nullptr);
  const auto launch =
      "filesrc location=\"" + path + "\" ! decodebin ! videoconvert ! videoscale ! " +
      "video/x-raw,format=GRAY8,pixel-aspect-ratio=1/1,width=" + std::to_string(width) +
      ",height=" + std::to_string(height) + " ! appsink name=sink sync=false max-buffers=4";
  GstElement* pipeline = gst_parse_launch(launch.c_str(), nullptr);
  GstElement* sink = gst_bin_get_by_name(GST_BIN(pipeline), "sink");
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  int frames = 0;
  while (frames < count) {
    GstSample* sample = gst_app_sink_pull_sample(GST_APP_SINK(sink));
    if (sample == nullptr) break;
    GstMapInfo map;
    gst_buffer_map(gst_sample_get_buffer(sample), &map, GST_MAP_READ);
    visit(frames++, eventcamera::ImageView<std::uint8_t>{map.data, width, width, height});
    gst_buffer_unmap(gst_sample_get_buffer(sample), &map);
    gst_sample_unref(sample);
  }
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(sink);
  gst_object_unref(pipeline);
  return frames;
}

/// The video's clips; nothing, and a note, if $SHARED_DATA does not have it. With `few_frames` one
/// clip of three frames.
std::optional<Scene> read(Video video, bool few_frames) {
  const char* shared = std::getenv("SHARED_DATA");
  const auto path = std::string(shared != nullptr ? shared : "") + "/video/" + video.file;
  if (!std::filesystem::exists(path)) {
    std::fprintf(stderr, "%s not found: leaving out %s\n", path.c_str(), video.name.c_str());
    return {};
  }
  if (few_frames) video.spans = {{video.spans.front().first, 3}};
  Scene scene{video.name, std::vector<Clip>(video.spans.size()), video.interpolated_frames};
  const int end = video.spans.back().first + video.spans.back().count;
  const auto visit = [&](int i, const auto& frame) {
    for (std::size_t clip = 0; clip < video.spans.size(); ++clip) {
      const auto& [first, count] = video.spans[clip];
      if (i < first || i >= first + count) continue;
      scene.clips[clip].emplace_back(video.width, video.height).assign(frame);
    }
  };
  if (for_each_frame(path, end, video.width, video.height, visit) < end)
    throw std::runtime_error(path + " cannot be read, or is too short");
  return scene;
}

}  // namespace

Clip ball(int count) {
  constexpr int radius = 20;
  const auto ground = scene::texture<std::uint8_t>(1280, 720, 8, 0, 0);
  Clip clip;
  for (int i = 0; i < count; ++i) {
    auto& frame = clip.emplace_back(ground);
    for (int y = -radius; y < radius; ++y)
      for (int x = -radius; x < radius; ++x)
        if (x * x + y * y < radius * radius) frame.at(200 + 30 * i + x, 300 + 8 * i + y) = 240;
  }
  return clip;
}

std::vector<Scene> scenes(bool few_frames) {
  const std::string cars = "cars-768x432-12fps.mp4";
  const Video videos[] = {
      driving_video(640, 480),
      {"cars-1280x720", cars, {{66, 4}, {325, 4}}, 1280, 720, 10},
      // About as much changes in them as on average in frames 200 to 225, the busiest.
      {"busy-cars-1280x720", cars, {{200, 4}, {214, 4}}, 1280, 720, 10},
      {"bottles-640x360", "bottles-640x360-30fps.mp4", {{0, 4}, {82, 4}}, 640, 360, 10},
  };
  std::vector<Scene> scenes;
  for (const auto& video : videos)
    if (auto scene = read(video, few_frames)) scenes.push_back(std::move(*scene));
  scenes.push_back({"ball-1280x720", {ball(few_frames ? 3 : 7)}, 10});
  return scenes;
}

std::optional<Scene> driving(int width, int height, bool few_frames) {
  return read(driving_video(width, height), few_frames);
}

Clip moving_patch(int width, int height, double share, int count) {
  const auto ground = scene::texture<std::uint8_t>(width, height, 8, 0, 0);
  const int patch_width = static_cast<int>(std::lround(width * std::sqrt(share)));
  const int patch_height = static_cast<int>(std::lround(height * std::sqrt(share)));
  Clip clip;
  for (int i = 0; i < count; ++i) {
    const int left = std::min((width - patch_width) / 2 + 4 * i, width - patch_width);
    const int top = std::min((height - patch_height) / 2 + 2 * i, height - patch_height);
    // A patch that cannot move has a moving texture instead.
    const auto patch = scene::texture<std::uint8_t>(
        patch_width, patch_height, 8, 1000 + (left == width - patch_width ? -4.0 * i : 0.0),
        500 + (top == height - patch_height ? -2.0 * i : 0.0));
    auto& frame = clip.emplace_back(ground);
    for (int y = 0; y < patch_height; ++y)
      std::copy_n(patch.row(y), patch_width, frame.row(top + y) + left);
  }
  return clip;
}

}  // namespace bench
