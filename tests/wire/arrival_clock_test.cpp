// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/wire/arrival_clock.hpp"

#include <gtest/gtest.h>

#include <random>

namespace {

using namespace eventcamera;

constexpr Nanoseconds millisecond = 1'000'000;

/// Transfers each 10 ms, delayed by up to 8 ms, of a camera whose clock is slow by `ppm`.
struct Transfers {
  explicit Transfers(double slow_by) : ppm(slow_by) {}

  /// True if the offset changed.
  bool arrive(ArrivalClock& clock) {
    now += 10 * millisecond;
    const auto delay = std::uniform_int_distribution<Nanoseconds>(0, 8 * millisecond)(random);
    return clock.arrive(sent(), now + delay, false);
  }

  Microseconds sent() const {
    return start + static_cast<Microseconds>(static_cast<double>(now) * (1 - ppm * 1e-6) / 1000);
  }

  double ppm;
  Microseconds start = 5'000'000;
  Nanoseconds now = 0;
  std::mt19937 random{1};
};

TEST(ArrivalClock, TakesTheFirstAndEarlierTransfersAtOnce) {
  ArrivalClock clock;
  EXPECT_FALSE(clock.offset());
  EXPECT_TRUE(clock.arrive(1'000, 500 * millisecond, false));
  EXPECT_EQ(clock.offset(), 499 * millisecond);
  EXPECT_TRUE(clock.arrive(10'000, 20 * millisecond, false));
  EXPECT_EQ(clock.offset(), 10 * millisecond);
}

TEST(ArrivalClock, IgnoresDelays) {
  ArrivalClock clock;
  clock.arrive(0, 0, false);
  for (int i = 1; i < 3000; ++i) {
    const auto late = i % 10 == 0 ? 0 : 30 * millisecond;
    EXPECT_FALSE(clock.arrive(Microseconds{i} * 10'000, i * 10 * millisecond + late, false));
  }
  EXPECT_EQ(clock.offset(), 0);
}

TEST(ArrivalClock, MapsDriftingClocksToWithinItsBound) {
  for (const double ppm : {-300.0, -50.0, 0.0, 50.0, 300.0}) {
    SCOPED_TRACE(ppm);
    Transfers transfers(ppm);
    ArrivalClock clock;
    int changes = 0;
    for (int i = 0; i < 60'000; ++i) {
      changes += transfers.arrive(clock) ? 1 : 0;
      if (i < 100) continue;
      const auto error = transfers.sent() * 1000 + *clock.offset() - transfers.now;
      ASSERT_LT(std::abs(error), 2 * millisecond) << i;
    }
    // 1 ms each, and those of the first transfers.
    EXPECT_LE(changes, std::abs(ppm) * 600e-6 * 1000 * 1.3 + 10);
    EXPECT_NEAR(clock.drift(), ppm, 2);
  }
}

TEST(ArrivalClock, BeginsAnewIfTheClockIsAnotherOne) {
  ArrivalClock clock;
  clock.arrive(1'000'000, 0, false);
  EXPECT_FALSE(clock.arrive(1'010'000, 10 * millisecond, true));
  EXPECT_FALSE(clock.arrive(20'000, 20 * millisecond, false)) << "only after a gap";
  EXPECT_TRUE(clock.arrive(30'000, 30 * millisecond, true));
  EXPECT_EQ(clock.offset(), 0);
}

}  // namespace
