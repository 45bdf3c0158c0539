// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "src/formats/decoder.hpp"

namespace eventcamera {

/// A file of events that is no stream of bytes: what is needed next lies anywhere in it.
class EventFile {
 public:
  struct TimeRange {
    Microseconds first, last;
  };

  virtual ~EventFile() = default;
  EventFile(const EventFile&) = delete;
  EventFile& operator=(const EventFile&) = delete;

  /// The sensor's size, where the file tells it; else 0x0.
  virtual SensorSize size() const = 0;

  /// The times of the first and the last event; nothing where there are none.
  virtual std::optional<TimeRange> time_range() const = 0;

  /// Appends up to `count` events, fewer only at the end, and returns how many.
  virtual std::size_t read(std::size_t count, std::vector<AbsoluteEvent>& out) = 0;

  /// The same of a camera's triggers.
  virtual std::size_t read_triggers(std::size_t count, std::vector<Trigger>& out) = 0;

  /// Events and triggers before `t` are gone over, or come back.
  virtual void seek(Microseconds t) = 0;

  virtual const Corruption& corruption() const = 0;

 protected:
  EventFile() = default;
};

}  // namespace eventcamera
