// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/renderer.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

namespace eventcamera {
namespace {

/// Pixel of each shade or kind.
using Pixels = std::array<PixelBytes, 256>;

template <std::size_t bytes>
void draw_row(std::span<const std::uint8_t> row, const Pixels& pixels, std::byte* out) {
  for (const auto which : row) {
    std::memcpy(out, pixels[which].data(), bytes);
    out += bytes;
  }
}

Pixels pixels_of(const RenderSettings& settings, const PixelLayout& layout) {
  Pixels pixels{};
  if (settings.mode == RenderMode::accumulate)
    std::ranges::copy(pixels_by_kind(palette(settings.palette), layout), pixels.begin());
  else
    std::ranges::transform(shades(settings.palette), pixels.begin(),
                           [&layout](const Colour& colour) { return pixel(colour, layout); });
  return pixels;
}

/// `side` pixels of a sensor in pixels of the picture.
int reduced(int side, int reduction) {
  return (side + reduction - 1) / reduction;
}

int reduction_of(int width, int height) {
  int reduction = 1;
  while (reduced(width, reduction) * reduced(height, reduction) > Renderer::max_pixels) ++reduction;
  return reduction;
}

}  // namespace

Renderer::Memory Renderer::make_memory(int width, int height, const RenderSettings& settings) {
  switch (settings.mode) {
    case RenderMode::decay:
      return DecayingSums(width, height, settings.time_constant, settings.full_scale);
    case RenderMode::time_surface:
      return TimeSurface(width, height, settings.time_constant);
    case RenderMode::reconstruct:
      return Reconstruction(width, height, settings.reconstruction);
    case RenderMode::accumulate:
    case RenderMode::count:
      break;
  }
  return EventWindow(width, height, settings.limits);
}

Renderer::Renderer(int width, int height, const RenderSettings& settings)
    : reduction_(reduction_of(width, height)),
      width_(reduced(width, reduction_)),
      height_(reduced(height, reduction_)),
      settings_(settings),
      memory_(make_memory(width_, height_, settings)),
      validator_(width, height),
      row_(static_cast<std::size_t>(width_)) {}

void Renderer::configure(const RenderSettings& settings) {
  auto repainted = settings_;
  repainted.palette = settings.palette;
  if (repainted != settings) memory_ = make_memory(width_, height_, settings);
  settings_ = settings;
}

void Renderer::reset() {
  memory_ = make_memory(width_, height_, settings_);
  validator_.restart();
  has_drawn_ = false;
}

InvalidEvents Renderer::add(std::span<const Event> events, Microseconds start, Microseconds max_t) {
  return std::visit(
      [&](auto& memory) {
        return validator_.for_each_valid(events, start, max_t, [&](const AbsoluteEvent& event) {
          memory.add(reduction_ == 1
                         ? event
                         : AbsoluteEvent::at(event.x / reduction_, event.y() / reduction_, event.t,
                                             event.polarity()));
        });
      },
      memory_);
}

void Renderer::shade_row(int y, Microseconds time) {
  const auto use = [this](int x, float value) { row_[static_cast<std::size_t>(x)] = shade(value); };
  if (const auto* sums = std::get_if<DecayingSums>(&memory_)) {
    sums->read_row(y, time, use);
  } else if (const auto* surface = std::get_if<TimeSurface>(&memory_)) {
    surface->read_row(y, time, use);
  } else if (const auto* reconstruction = std::get_if<Reconstruction>(&memory_)) {
    reconstruction->read_row(y, use);
  } else {
    const auto* counts = std::get<EventWindow>(memory_).row(y);
    if (settings_.mode == RenderMode::accumulate) {
      std::transform(counts, counts + width_, row_.begin(), kind_of);
      return;
    }
    const float scale = 1 / settings_.full_scale;
    for (int x = 0; x < width_; ++x)
      use(x, (static_cast<float>(counts[x].on) - static_cast<float>(counts[x].off)) * scale);
  }
}

void Renderer::draw(Microseconds start, Microseconds end, const PixelLayout& layout, std::byte* out,
                    std::ptrdiff_t stride) {
  const auto time = std::max(validator_.passed(), end);
  validator_.pass(end + 1);
  const bool is_first = !std::exchange(has_drawn_, true);
  if (auto* window = std::get_if<EventWindow>(&memory_))
    window->begin_at(is_first ? start : start + 1);
  if (auto* reconstruction = std::get_if<Reconstruction>(&memory_))
    reconstruction->finish_picture();
  const auto pixels = pixels_of(settings_, layout);
  for (int y = 0; y < height_; ++y) {
    shade_row(y, time);
    auto* row = out + y * stride;
    if (layout.bytes == 1)
      draw_row<1>(row_, pixels, row);
    else if (layout.bytes == 3)
      draw_row<3>(row_, pixels, row);
    else
      draw_row<4>(row_, pixels, row);
  }
}

}  // namespace eventcamera
