// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/parallel/thread_pool.hpp"

#include <algorithm>
#include <utility>

namespace eventcamera {

ThreadPool::~ThreadPool() {
  join_workers();
}

void ThreadPool::set_threads(int threads) {
  // Asked once: the C library reads it out of a file.
  static const int processors = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int wanted = threads == 0 ? processors : std::clamp(threads, 1, processors);
  if (wanted == this->threads()) return;
  join_workers();
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
  loop_ = 0;
}

void ThreadPool::run(int count, Round round, const void* body) {
  {
    const std::lock_guard lock(mutex_);
    round_ = round;
    body_ = body;
    count_ = count;
    next_ = 0;
    busy_ = static_cast<int>(workers_.size());
    ++loop_;
  }
  wake_.notify_all();
  take_rounds(0);
  std::unique_lock lock(mutex_);
  done_.wait(lock, [this] { return busy_ == 0; });
  if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
}

void ThreadPool::take_rounds(int thread) {
  try {
    for (int i = next_++; i < count_; i = next_++) round_(body_, i, thread);
  } catch (...) {
    next_ = count_;
    const std::lock_guard lock(mutex_);
    thrown_ = std::current_exception();
  }
}

void ThreadPool::work(int thread) {
  unsigned seen = 0;
  std::unique_lock lock(mutex_);
  for (;;) {
    wake_.wait(lock, [&] { return stop_ || loop_ != seen; });
    if (stop_) return;
    seen = loop_;
    lock.unlock();
    take_rounds(thread);
    lock.lock();
    if (--busy_ == 0) done_.notify_one();
  }
}

}  // namespace eventcamera
