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

/// Text and cause of the error that ends a file.
std::string error_of(std::string_view file, const std::string& reader, const std::string& caps) {
  Reader h(reader, caps);
  push_segment(h.get(), {.format = GST_FORMAT_BYTES});
  h.read(file);
  const auto message = h.message(GST_MESSAGE_ERROR);
  if (!message) return "";
  GError* error = nullptr;
  gchar* cause = nullptr;
  gst_message_parse_error(message.get(), &error, &cause);
  const std::string texts = error->message + std::string(cause);
  g_error_free(error);
  g_free(cause);
  return texts;
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
    const auto text = error_of(file, reader, caps);
    EXPECT_NE(text.find("\xEF\xBF\xBD"), std::string::npos) << text;
    EXPECT_TRUE(g_utf8_validate(text.data(), static_cast<gssize>(text.size()), nullptr)) << text;
  }
}

}  // namespace
