// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/event_list.hpp"

#include <bit>

#include "src/gl/shaders.hpp"

namespace eventcamera::gl {
namespace {

constexpr int block = 512;  ///< marks a group, as in the shaders

constexpr std::size_t first_capacity = 4096;  ///< events

/// Time in which a driver must complete an interval, nanoseconds.
constexpr GLuint64 patience = 60'000'000'000;

}  // namespace

EventList::EventList(const Context& gl, const LumaFormat& format)
    : gl_(gl),
      marks_across_(groups_of(32, format.width)),
      height_(format.height),
      count_(gl, "count", shaders::count),
      scan_(gl, "scan", shaders::scan),
      write_(gl, "write", shaders::write),
      marks_(gl),
      starts_(gl),
      times_(gl),
      total_(gl, GL_DYNAMIC_READ),
      events_(gl, GL_DYNAMIC_READ) {
  total_.reserve(sizeof(std::uint32_t));
  events_.reserve(first_capacity * sizeof(Event));
}

void EventList::begin(int steps) {
  const auto count = static_cast<std::size_t>(steps);
  marks_.reserve(count * static_cast<std::size_t>(marks_a_step()) * 8);
  starts_.reserve(count * static_cast<std::size_t>(groups_of(block, marks_a_step())) * 4);
}

void EventList::write(int steps) const {
  write_.run({groups_of(block, marks_a_step()), steps}, {&marks_, &starts_, &times_, &events_},
             {marks_a_step(), marks_across_, static_cast<int>(events_.size() / sizeof(Event))});
}

void EventList::read(std::span<const std::uint32_t> times, EventBuckets& events) {
  const int steps = static_cast<int>(times.size());
  times_.assign(std::as_bytes(times));
  const Groups blocks{groups_of(block, marks_a_step()), steps};
  count_.run(blocks, {&marks_, &starts_}, {marks_a_step()});
  scan_.run({}, {&starts_, &total_}, {blocks.x * blocks.y});
  write(steps);

  const GLsync fence = gl_.FenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  const GLenum state = gl_.ClientWaitSync(fence, GL_SYNC_FLUSH_COMMANDS_BIT, patience);
  gl_.DeleteSync(fence);
  gl_.check();
  if (state == GL_TIMEOUT_EXPIRED) throw Error("OpenGL has not answered for a minute");
  std::uint32_t total = 0;
  total_.read(std::as_writable_bytes(std::span(&total, 1)));
  if (total > events_.size() / sizeof(Event)) {
    events_.reserve(std::bit_ceil(std::size_t{total}) * sizeof(Event));
    write(steps);
  }
  events.reset(1, 1);
  auto& list = events.bucket(1, 0);
  list.resize(total);
  events_.read(std::as_writable_bytes(std::span(list)));
  gl_.check();
}

}  // namespace eventcamera::gl
