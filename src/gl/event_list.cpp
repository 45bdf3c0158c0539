// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/event_list.hpp"

#include <array>
#include <bit>
#include <span>

#include "src/gl/shaders.hpp"

namespace eventcamera::gl {
namespace {

constexpr int block = 512;  ///< marks a group, as in the shaders

constexpr std::size_t first_capacity = 4096;  ///< events

}  // namespace

EventListKernels::EventListKernels(const Context& gl)
    : count(gl, "count", shaders::count),
      scan(gl, "scan", shaders::scan),
      write(gl, "write", shaders::write) {}

EventList::EventList(const Context& gl, const LumaFormat& format, const EventListKernels& kernels)
    : gl_(gl),
      kernels_(kernels),
      marks_across_(groups_of(32, format.width)),
      height_(format.height),
      marks_(gl),
      starts_(gl),
      step_times_(gl),
      total_(gl, GL_DYNAMIC_READ),
      events_(gl, GL_DYNAMIC_READ) {
  marks_.reserve(static_cast<std::size_t>(marks_a_step()) * 8);
  total_.reserve(sizeof(std::uint32_t));
  events_.reserve(first_capacity * sizeof(Event));
}

void EventList::begin(const StepTimes& steps, int first) {
  times_.clear();
  for (int j = first; j <= steps.count(); ++j) times_.push_back(steps.microseconds(j));
  marks_.reserve(times_.size() * static_cast<std::size_t>(marks_a_step()) * 8);
}

void EventList::assign(const EventBuckets& events) {
  times_.assign(2, 0);
  std::vector<std::array<std::uint32_t, 2>> marks(2 * static_cast<std::size_t>(marks_a_step()));
  for (int band = 0; band < events.bands(); ++band)
    events.visit_band(band, [&](std::span<const Event> span) {
      for (const Event& event : span) {
        const bool is_on = event.polarity() == Polarity::on;
        const int mark = event.y() * marks_across_ + event.x / 32 + (is_on ? marks_a_step() : 0);
        const std::uint32_t bit = std::uint32_t{1} << event.x % 32;
        marks[mark][0] |= bit;
        if (is_on) marks[mark][1] |= bit;
      }
    });
  marks_.assign(std::as_bytes(std::span(marks)));
}

void EventList::write() const {
  kernels_.write.run(
      {groups_of(block, marks_a_step()), steps()}, {&marks_, &starts_, &step_times_, &events_},
      {marks_a_step(), marks_across_, static_cast<int>(events_.size() / sizeof(Event))});
}

void EventList::sort() {
  step_times_.assign(std::as_bytes(std::span(times_)));
  const Groups blocks{groups_of(block, marks_a_step()), steps()};
  starts_.reserve(static_cast<std::size_t>(blocks.x) * times_.size() * 4);
  kernels_.count.run(blocks, {&marks_, &starts_}, {marks_a_step()});
  kernels_.scan.run({}, {&starts_, &total_}, {blocks.x * blocks.y});
  write();
}

void EventList::read(StepBuckets& events) {
  std::uint32_t total = 0;
  total_.read(std::as_writable_bytes(std::span(&total, 1)));
  if (total > times_.size() * static_cast<std::size_t>(marks_a_step()) * 32)
    throw Error("OpenGL returned more events than there are pixels");
  if (total > events_.size() / sizeof(Event)) {
    events_.reserve(std::bit_ceil(std::size_t{total}) * sizeof(Event));
    write();
  }
  events.reset(1, 1);
  auto& list = events.bucket(1, 0);
  list.resize(total);
  events_.read(std::as_writable_bytes(std::span(list)));
  gl_.check();
}

}  // namespace eventcamera::gl
