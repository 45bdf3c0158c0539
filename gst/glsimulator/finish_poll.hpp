// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <utility>

#include "gst/simulator/eventsimulator.hpp"

/// Makes the simulator of an element push finished intervals, a little later.
class FinishPoll {
 public:
  explicit FinishPoll(GstElement* element) : element_(element) {}
  ~FinishPoll() { cancel(); }
  FinishPoll(const FinishPoll&) = delete;
  FinishPoll& operator=(const FinishPoll&) = delete;

  /// Schedules a check, and cancels the pending one, if any.
  void schedule() {
    cancel();
    GstClock* clock = gst_system_clock_obtain();
    id_ = gst_clock_new_single_shot_id(clock, gst_clock_get_time(clock) + poll_interval);
    gst_object_unref(clock);
    auto* element = g_new0(GWeakRef, 1);
    g_weak_ref_init(element, element_);
    gst_clock_id_wait_async(id_, poll, element, [](gpointer data) {
      g_weak_ref_clear(static_cast<GWeakRef*>(data));
      g_free(data);
    });
  }

  void cancel() {
    if (id_ == nullptr) return;
    gst_clock_id_unschedule(id_);
    gst_clock_id_unref(std::exchange(id_, nullptr));
  }

 private:
  /// Interval at which to check whether the GPU has finished.
  static constexpr GstClockTime poll_interval = GST_MSECOND;

  /// Called in the thread of the clock, which must not wait for the stream lock or the GPU.
  static gboolean poll(GstClock*, GstClockTime, GstClockID, gpointer data) {
    auto* element = static_cast<GstElement*>(g_weak_ref_get(static_cast<GWeakRef*>(data)));
    if (element == nullptr) return TRUE;
    gst_element_call_async(
        element, [](GstElement* self, gpointer) { event_simulator_push_finished(self); }, nullptr,
        nullptr);
    gst_object_unref(element);
    return TRUE;
  }

  GstElement* element_;
  GstClockID id_ = nullptr;
};
