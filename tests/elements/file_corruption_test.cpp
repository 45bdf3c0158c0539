// SPDX-License-Identifier: LGPL-2.1-or-later
// Readers of event files with files that are corrupt or empty, or of another format.
#include <tuple>

#include "tests/elements/event_files.hpp"

namespace {

using namespace harness;
using namespace event_files;

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
  const bool is_text = format().name == "csv";  // without events, it may have no byte
  const TemporaryFile file;
  for (const std::string way : {"", "queue ! "}) {
    Player player(file.source() + way + format().reader);
    EXPECT_EQ(player.play(), is_text);
    EXPECT_EQ(player.error.starts_with("Cannot read this file: "), !is_text) << way << player.error;
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

TEST(FileReaders, QuoteTheBytesOfAFileInUtf8) {
  const std::string raw = "% format EVT\xff;width=2;height=2\n% end\n";
  const std::string order = "% format EVT21;endianness=\xfe;width=2;height=2\n% end\n";
  const std::string version = "#!AER-DAT\xff.0\r\n";
  const std::string camera = "#!AER-DAT2.0\r\n# AEChip: \xff\r\n#End Of ASCII Header\r\n";
  for (const auto& [file, reader, caps] :
       {std::tuple{raw, "evtdec", "application/x-prophesee-raw"},
        {order, "evtdec", "application/x-prophesee-raw"},
        {version, "aedatdemux", "application/x-aedat, version=2"},
        {camera, "aedatdemux", "application/x-aedat, version=2"}}) {
    Reader h(reader, caps);
    push_segment(h.get(), {.format = GST_FORMAT_BYTES});
    h.read(file);
    const auto text = h.error();
    EXPECT_TRUE(contains(text, "\xEF\xBF\xBD"));
    EXPECT_TRUE(g_utf8_validate(text.data(), static_cast<gssize>(text.size()), nullptr)) << text;
  }
}

/// Lines of a log: their level and text.
using Log = std::vector<std::pair<GstDebugLevel, std::string>>;

void take_line(GstDebugCategory* category, GstDebugLevel level, const gchar*, const gchar*, gint,
               GObject*, GstDebugMessage* message, gpointer log) {
  const std::string text = gst_debug_message_get(message);
  if (gst_debug_category_get_name(category) == std::string_view("eventreader") &&
      text.find("Corrupt data at byte") != text.npos)
    static_cast<Log*>(log)->emplace_back(level, text);
}

/// The first place is a warning.
TEST(FileReaders, LogEachPlaceThatIsCorrupt) {
  gst_init(nullptr, nullptr);
  std::string table = "t,x,y,p\n";
  std::vector<std::size_t> corrupt;
  for (int t = 0; t < 15'000; ++t) {
    if (t % 5000 == 1) corrupt.push_back(table.size());
    table += t % 5000 == 1 ? "?\n" : std::to_string(20 * t) + ",1,1,1\n";
  }
  const TemporaryFile file(table);
  Log log;
  gst_debug_set_threshold_for_name("eventreader", GST_LEVEL_LOG);
  gst_debug_remove_log_function(gst_debug_log_default);
  gst_debug_add_log_function(take_line, &log, nullptr);
  {
    Pipeline pipeline(file.source() + "queue ! eventcsvdec width=8 height=8 ! fakesink");
    EXPECT_TRUE(pipeline.play()) << pipeline.error;
  }
  gst_debug_remove_log_function_by_data(&log);
  gst_debug_unset_threshold_for_name("eventreader");
  ASSERT_EQ(log.size(), corrupt.size());
  for (std::size_t i = 0; i < log.size(); ++i) {
    EXPECT_EQ(log[i].first, i == 0 ? GST_LEVEL_WARNING : GST_LEVEL_LOG);
    EXPECT_TRUE(contains(log[i].second, "the last at byte " + std::to_string(corrupt[i])));
  }
}

}  // namespace
