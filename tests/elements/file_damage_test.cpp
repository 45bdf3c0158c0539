// SPDX-License-Identifier: LGPL-2.1-or-later
// Readers of event files with files that are damaged or empty, or of another format.
#include "tests/elements/event_files.hpp"

namespace {

using namespace harness;
using namespace event_files;

INSTANTIATE_TEST_SUITE_P(, EveryFormat, testing::ValuesIn(formats), name_of);

/// A format that is read up to where a file is truncated.
class EveryStream : public EveryFormat {};

INSTANTIATE_TEST_SUITE_P(, EveryStream, testing::ValuesIn(stream_formats()), name_of);

TEST_P(EveryFormat, SaysWhenItIsUnsupportedFormat) {
  for (const auto& file : {std::string("a,b\n"), std::string("no events at all, but words\n"),
                           std::string(100'000, '\0')}) {
    Reader h(format());
    h.read(file, 4000);
    EXPECT_TRUE(h.error().starts_with("Cannot read this file: "));
    EXPECT_EQ(h.error(), "");

    const TemporaryFile temporary(file);
    Player player(temporary.source() + format().reader);
    EXPECT_FALSE(player.play());
    EXPECT_TRUE(player.error.starts_with("Cannot read this file: ")) << player.error;
  }
}

TEST_P(EveryFormat, IsNoFileWithoutAByte) {
  const TemporaryFile file;
  for (const std::string way : {"", "queue ! "}) {
    Player player(file.source() + way + format().reader);
    EXPECT_FALSE(player.play());
    EXPECT_TRUE(player.error.starts_with("Cannot read this file: ")) << way << player.error;
  }
}

TEST_P(EveryStream, WarnsOnceOfCorruptionAndTellsWhere) {
  const auto events = some_events();
  auto file = file_of(format(), events);
  if (format().end.empty())
    file.pop_back();
  else
    file += format().end;
  Reader h(format());
  h.read(file, 5000);
  const auto text = h.warning();
  const auto found = text.find("data at byte ");
  ASSERT_NE(found, std::string::npos) << text;
  const auto position = std::stoul(text.substr(found + 13));
  EXPECT_LT(position, file.size());
  EXPECT_GE(position + 13, file.size());  // size of the longest event
  EXPECT_EQ(h.warning() + h.error(), "");
  // Nearly all events were intact.
  const auto read = pull_events(h);
  ASSERT_GT(read.size(), events.size() - 40);
  EXPECT_TRUE(std::equal(read.begin(), read.end(), events.begin()));
  EXPECT_EQ(stat_of(h.element(), "corrupt-places"), 1U);
}

TEST(EventNpzDec, SaysWhenAnArchiveIsTruncated) {
  const auto file = file_of(format_of("npz"), some_events());
  for (const std::size_t size : {1UL, file.size() / 2, file.size() - 1}) {
    Reader h(format_of("npz"));
    h.read(file.substr(0, size));
    EXPECT_TRUE(h.error().starts_with("Cannot read this file: "));
    EXPECT_TRUE(pull_events(h).empty());
  }
}

TEST_P(EveryFormat, SurvivesNoise) {
  const auto file = file_of(format(), some_events());
  for (unsigned seed = 0; seed < 20; ++seed) {
    auto noisy = file;
    g_random_set_seed(seed);
    for (int i = 0; i < 200; ++i)
      noisy[static_cast<std::size_t>(g_random_int_range(200, static_cast<gint>(noisy.size())))] ^=
          static_cast<char>(1 << g_random_int_range(0, 8));
    Reader h(format());
    h.read(noisy, 3000);
    for (const auto& event : pull_events(h)) {
      if (!format().tells_size) break;
      ASSERT_LT(event.x, width);
      ASSERT_LT(event.y(), height);
    }
  }
}

}  // namespace
