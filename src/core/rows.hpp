// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>

#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Runs body(y) for y = 0 ... rows - 1, many rows a round: one alone is too little for a thread.
template <class Body>
void for_each_row(ThreadPool& threads, int rows, const Body& body) {
  constexpr int rows_per_round = 32;
  threads.for_each((rows + rows_per_round - 1) / rows_per_round, [&](int round, int) {
    const int end = std::min(rows, (round + 1) * rows_per_round);
    for (int y = round * rows_per_round; y < end; ++y) body(y);
  });
}

}  // namespace eventcamera
