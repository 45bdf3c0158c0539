// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "gst/base/properties.hpp"

/// Settings of payloaders, which hold events to fill packets.
struct PayloaderSettings {
  GstClockTime max_latency = 5 * GST_MSECOND;
};

/// Adds the property max-latency. Settings are derived from PayloaderSettings.
template <auto settings_of>
void add_max_latency(Properties<settings_of>& properties) {
  properties.add(&PayloaderSettings::max_latency, "max-latency",
                 "Maximum time for which an event waits for others to fill its packet (ns; 0 = "
                 "send each buffer at once)",
                 0, GST_SECOND);
}

/// Calls a function, in a thread of its own, when a deadline passes. The thread starts with the
/// first deadline.
class FlushTimer {
 public:
  using Flush = void (*)(GstObject* element);

  FlushTimer() = default;
  ~FlushTimer() { stop(); }
  FlushTimer(const FlushTimer&) = delete;
  FlushTimer& operator=(const FlushTimer&) = delete;

  /// Replaces the deadline: `delay` from now, `flush` is called with the element of `pad`, under
  /// the pad's stream lock.
  void set(GstClockTime delay, GstPad* pad, Flush flush) {
    {
      const std::lock_guard lock(mutex_);
      deadline_ = Clock::now() + std::chrono::nanoseconds(delay);
      pad_ = pad;
      flush_ = flush;
    }
    changed_.notify_one();
    if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
  }

  /// Removes the deadline; does not wait for a running call.
  void cancel() {
    const std::lock_guard lock(mutex_);
    deadline_.reset();
  }

  /// Removes the deadline, waits for a running call, and ends the thread.
  void stop() {
    {
      const std::lock_guard lock(mutex_);
      is_stopped_ = true;
    }
    changed_.notify_one();
    if (thread_.joinable()) thread_.join();
    is_stopped_ = false;
    deadline_.reset();
  }

 private:
  using Clock = std::chrono::steady_clock;

  void run() {
    std::unique_lock lock(mutex_);
    while (!is_stopped_) {
      if (!deadline_) {
        changed_.wait(lock);
      } else if (Clock::now() < *deadline_) {
        changed_.wait_until(lock, Clock::time_point(*deadline_));
      } else {
        deadline_.reset();
        GstPad* const pad = pad_;
        const Flush flush = flush_;
        lock.unlock();
        GST_PAD_STREAM_LOCK(pad);
        flush(GST_OBJECT_PARENT(pad));
        GST_PAD_STREAM_UNLOCK(pad);
        lock.lock();
      }
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Clock::time_point> deadline_;  ///< guarded by mutex_
  GstPad* pad_ = nullptr;                      ///< guarded by mutex_
  Flush flush_ = nullptr;                      ///< guarded by mutex_
  bool is_stopped_ = false;                    ///< guarded by mutex_
  std::thread thread_;
};
