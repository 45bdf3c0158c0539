// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace eventcamera {

/// Pool of threads for parallel loops. Must be called from one thread at a time.
///
/// The loops of a frame follow each other closely and can be shorter than the wake-up time of a
/// thread. So threads yield for a while before they sleep, and a loop does not wait for late ones.
///
/// Any thread may run any round of a loop. Each round must write only its own data, so that the
/// result does not depend on the number of threads.
class ThreadPool {
 public:
  ThreadPool() = default;
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  /// Sets the number of threads of the next loops, including the caller; 0 = one per processor.
  void set_threads(int threads);
  int threads() const { return static_cast<int>(workers_.size()) + 1; }

  /// Runs body(i, thread) for i = 0 ... count - 1, thread = 0 ... threads() - 1, and returns when
  /// all are done. An exception from a body is rethrown after the loop.
  template <class Body>
  void for_each(int count, const Body& body) {
    run(
        count, [](const void* b, int i, int thread) { (*static_cast<const Body*>(b))(i, thread); },
        &body);
  }

 private:
  /// Rounds that a thread runs before it helps other threads: the same in each loop over an image,
  /// so that its cache often has their data.
  struct alignas(64) Share {
    std::atomic<int> next = 0;
    int end = 0;
  };

  using Round = void (*)(const void* body, int i, int thread);

  void run(int count, Round round, const void* body);
  void run_rounds(int thread);
  void work(int thread);
  bool try_enter();
  void leave();
  bool try_close();
  void join_workers();

  std::vector<std::thread> workers_;

  // The current loop; written only while inside_ is closed.
  Round round_ = nullptr;
  const void* body_ = nullptr;
  std::vector<Share> shares_ = std::vector<Share>(1);  ///< one per thread

  static constexpr int closed = -1;
  std::atomic<int> inside_ = closed;  ///< workers in the current loop
  std::atomic<unsigned> loops_ = 0;   ///< number of loops started; signals workers
  std::atomic<bool> stop_ = false;

  std::mutex mutex_;  ///< guards thrown_ and the conditions
  std::condition_variable wake_;
  std::condition_variable done_;
  std::exception_ptr thrown_;
};

/// Runs body(y) for y = 0 ... rows - 1 in rounds of many rows, because a single row is too little
/// work for a round.
template <class Body>
void for_each_row(ThreadPool& threads, int rows, const Body& body) {
  constexpr int rows_per_round = 32;
  threads.for_each((rows + rows_per_round - 1) / rows_per_round, [&](int round, int) {
    const int end = std::min(rows, (round + 1) * rows_per_round);
    for (int y = round * rows_per_round; y < end; ++y) body(y);
  });
}

/// Rows per band. Frames are processed in bands of fixed size, so that results do not depend on the
/// number of threads.
inline constexpr int rows_per_band = 16;

inline int band_count(int height) {
  return (height + rows_per_band - 1) / rows_per_band;
}

/// Rows [first, last) of a band.
struct BandRows {
  BandRows(int band, int height)
      : first(band * rows_per_band), last(std::min(first + rows_per_band, height)) {}
  int first;
  int last;
};

}  // namespace eventcamera
