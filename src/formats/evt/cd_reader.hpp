// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/formats/evt/cd_word.hpp"
#include "src/formats/evt/time_high.hpp"
#include "src/formats/unit_reader.hpp"

namespace eventcamera {

/// What the readers of EVT2, EVT2.1 and EVT4 know: all that is before an event is the time.
class CdReader : public UnitReader {
 public:
  State state() const override { return time_.state(); }
  void restore(const State& state) override { time_.restore(state.clock, state.rest != 0); }

 protected:
  explicit CdReader(SensorSize size) : bounds_(size, 2048) {}

  /// Takes a trigger, where its time is known.
  void read_trigger(CdWord word, Batch& batch) const {
    if (time_.known()) batch.triggers->push_back(word.trigger(time_.time()));
  }

  Bounds bounds_;
  TimeHigh<28, 6> time_;
};

}  // namespace eventcamera
