// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/event_window.hpp"

namespace eventcamera {
namespace {

int areas_along(int pixels, int side) {
  return (pixels + side - 1) / side;
}

}  // namespace

EventWindow::EventWindow(int width, int height, const WindowLimits& limits)
    : limits_(limits), counts_(width, height), areas_across_(areas_along(width, limits.area_side)) {
  if (limits.area_events > 0)
    areas_.resize(static_cast<std::size_t>(areas_across_) *
                  static_cast<std::size_t>(areas_along(height, limits.area_side)));
}

std::size_t& EventWindow::area_of(const AbsoluteEvent& event) {
  const int column = event.x / limits_.area_side;
  const int row = event.y() / limits_.area_side;
  return areas_[static_cast<std::size_t>(row) * static_cast<std::size_t>(areas_across_) +
                static_cast<std::size_t>(column)];
}

void EventWindow::add(const AbsoluteEvent& event) {
  if (events_.full()) drop_oldest();
  events_.push(event);
  auto& counts = counts_.at(event.x, event.y());
  ++(event.polarity() == Polarity::on ? counts.on : counts.off);
  if (limits_.events > 0)
    while (events_.size() > limits_.events) drop_oldest();
  if (limits_.area_events > 0) {
    auto& area = area_of(event);
    ++area;
    while (area > limits_.area_events) drop_oldest();
  }
}

void EventWindow::begin_at(Microseconds time) {
  while (!events_.empty() && events_.front().t < time) drop_oldest();
}

void EventWindow::drop_oldest() {
  const auto& event = events_.front();
  auto& counts = counts_.at(event.x, event.y());
  --(event.polarity() == Polarity::on ? counts.on : counts.off);
  if (limits_.area_events > 0) --area_of(event);
  events_.pop();
}

}  // namespace eventcamera
