// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

/// Calls a function, in a thread of its own, when a deadline passes. The thread starts with the
/// first deadline.
class FlushTimer {
 public:
  using Clock = std::chrono::steady_clock;

  explicit FlushTimer(std::function<void()> flush) : flush_(std::move(flush)) {}
  ~FlushTimer() { stop(); }
  FlushTimer(const FlushTimer&) = delete;
  FlushTimer& operator=(const FlushTimer&) = delete;

  /// Replaces the deadline.
  void set(Clock::time_point deadline) {
    {
      const std::lock_guard lock(mutex_);
      deadline_ = deadline;
    }
    changed_.notify_one();
    if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
  }

  /// Ends the thread, after a running call, which may still use this object.
  void stop() {
    {
      const std::lock_guard lock(mutex_);
      is_stopped_ = true;
    }
    changed_.notify_one();
    if (thread_.joinable()) thread_.join();
  }

  /// Removes the deadline; a running call may still go on.
  void cancel() {
    const std::lock_guard lock(mutex_);
    deadline_.reset();
  }

 private:
  void run() {
    std::unique_lock lock(mutex_);
    while (!is_stopped_) {
      if (!deadline_) {
        changed_.wait(lock);
      } else if (Clock::now() < *deadline_) {
        changed_.wait_until(lock, Clock::time_point(*deadline_));
      } else {
        deadline_.reset();
        lock.unlock();
        flush_();
        lock.lock();
      }
    }
  }

  std::function<void()> flush_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Clock::time_point> deadline_;  ///< guarded by mutex_
  bool is_stopped_ = false;                    ///< guarded by mutex_
  std::thread thread_;
};
