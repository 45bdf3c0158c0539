// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/thread_pool.hpp"

#include <algorithm>
#include <utility>

namespace eventcamera {
namespace {

/// Yields until a condition is true, for about 50 microseconds. Returns its final value.
template <class Condition>
bool soon(const Condition& condition) {
  constexpr int tries = 100;
  for (int i = 0; i < tries; ++i) {
    if (condition()) return true;
    std::this_thread::yield();
  }
  return condition();
}

}  // namespace

ThreadPool::~ThreadPool() {
  join_workers();
}

void ThreadPool::set_threads(int threads) {
  // Cached, because the C library reads it from a file.
  static const int processors = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int wanted = threads == 0 ? processors : std::clamp(threads, 1, processors);
  if (wanted == this->threads()) return;
  join_workers();
  shares_ = std::vector<Share>(static_cast<std::size_t>(wanted));
  for (int thread = 1; thread < wanted; ++thread)
    workers_.emplace_back([this, thread] { work(thread); });
}

void ThreadPool::join_workers() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  for (auto& worker : workers_) worker.join();
  workers_.clear();
  stop_ = false;
}

void ThreadPool::run(int count, Round round, const void* body) {
  round_ = round;
  body_ = body;
  int first = 0;
  for (std::size_t i = 0; i < shares_.size(); ++i) {
    shares_[i].next = first;
    first += (count - first) / static_cast<int>(shares_.size() - i);
    shares_[i].end = first;
  }
  if (workers_.empty() || count < 2) {
    run_rounds(0);
  } else {
    inside_ = 0;
    {
      const std::lock_guard lock(mutex_);
      ++loops_;
    }
    wake_.notify_all();
    run_rounds(0);
    if (!soon([this] { return try_close(); })) {
      std::unique_lock lock(mutex_);
      done_.wait(lock, [this] { return try_close(); });
    }
  }
  if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
}

bool ThreadPool::try_enter() {
  int inside = inside_;
  while (inside != closed)
    if (inside_.compare_exchange_weak(inside, inside + 1)) return true;
  return false;
}

void ThreadPool::leave() {
  if (--inside_ > 0) return;
  const std::lock_guard lock(mutex_);
  done_.notify_one();
}

bool ThreadPool::try_close() {
  int nobody = 0;
  return inside_.compare_exchange_strong(nobody, closed);
}

void ThreadPool::run_rounds(int thread) {
  try {
    const auto own = static_cast<std::size_t>(thread);
    for (std::size_t i = 0; i < shares_.size(); ++i) {
      auto& share = shares_[(own + i) % shares_.size()];
      for (int k = share.next++; k < share.end; k = share.next++) round_(body_, k, thread);
    }
  } catch (...) {
    for (auto& share : shares_) share.next = share.end;
    const std::lock_guard lock(mutex_);
    thrown_ = std::current_exception();
  }
}

void ThreadPool::work(int thread) {
  unsigned seen = 0;
  for (;;) {
    const auto called = [&] { return stop_ || loops_ != seen; };
    if (!soon(called)) {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, called);
    }
    if (stop_) return;
    seen = loops_;
    if (!try_enter()) continue;
    run_rounds(thread);
    leave();
  }
}

}  // namespace eventcamera
