// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/label.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

namespace {

using namespace eventcamera;

TEST(Label, LiesInMemoryAsTheMetaHasIt) {
  const Label label{.object_class = 0x0102, .cause = Cause::hot_pixel};
  const unsigned char expected[] = {0x02, 0x01, 4, 0};
  EXPECT_EQ(std::memcmp(&label, expected, sizeof label), 0);
}

/// Events 0 ... count - 1 at these columns, whose labels have the columns as their class.
struct Numbered {
  std::vector<Event> events;
  std::vector<Label> labels;

  explicit Numbered(int count) {
    for (int i = 0; i < count; ++i) {
      events.push_back(Event::at(i, 0, 0, Polarity::on));
      labels.push_back({static_cast<std::uint16_t>(i), Cause::light});
    }
  }
};

TEST(LabelledEvents, AreKeptWithTheirLabels) {
  Numbered numbered(10);
  const LabelledEvents all{numbered.events, numbered.labels};
  const auto kept = all.keep_if([](const Event& event) { return event.x % 3 == 1; });
  ASSERT_EQ(kept.events.size(), 3U);
  ASSERT_EQ(kept.labels.size(), 3U);
  EXPECT_EQ(kept.events.data(), numbered.events.data());
  EXPECT_EQ(kept.labels.data(), numbered.labels.data());
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(kept.events[i].x, 3 * i + 1);
    EXPECT_EQ(kept.labels[i].object_class, 3 * i + 1);
  }
}

TEST(LabelledEvents, MayHaveNoLabelsAndMayBeChanged) {
  Numbered numbered(10);
  const LabelledEvents all{numbered.events, {}};
  int calls = 0;
  const auto kept = all.keep_if([&](Event& event) {
    EXPECT_EQ(event.x, calls++);
    event.x = static_cast<std::uint16_t>(event.x + 100);
    return event.x >= 105;
  });
  EXPECT_EQ(calls, 10);
  ASSERT_EQ(kept.events.size(), 5U);
  EXPECT_TRUE(kept.labels.empty());
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(kept.events[i].x, 105 + i);
  EXPECT_EQ(numbered.labels, Numbered(10).labels);
}

}  // namespace
