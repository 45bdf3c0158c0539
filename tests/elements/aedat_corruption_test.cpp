// SPDX-License-Identifier: LGPL-2.1-or-later
// aedatdemux with AEDAT files that are corrupt or empty, and with files that are not AEDAT.
#include "tests/elements/aedat_player.hpp"
#include "tests/elements/aedat_recordings.hpp"

namespace {

using namespace harness;
using namespace aedat_recordings;

TEST(AedatDemux, SaysWhereTheTableIsWrong) {
  const auto events = steady_events(2'000'000, 50);
  const auto whole = aedat4_file(events);
  Aedat4Decoder decoder;
  decoder.push(whole);
  while (decoder.next()) continue;
  const auto table_at = decoder.table_at().value();
  Aedat4Encoder encoder({sensor, "a camera", Aedat4Compression::lz4, false, true});
  Bytes ignored;
  encoder.finish(ignored);
  const auto field_at = encoder.patch().value().position;

  struct Fault {
    std::size_t at;
    const char* what;
    Bytes bytes;
  };
  auto overwritten = whole;
  for (auto i = table_at + 8; i < overwritten.size(); ++i) overwritten[i] ^= 0x5a;
  auto cut = whole;
  cut.resize(table_at);
  auto far = whole;
  far[field_at + 5] = 1;
  auto near = whole;
  near[field_at] ^= 0x10;
  const Fault faults[] = {
      {table_at, "the packet table that the header states is missing", overwritten},
      {table_at, "the file ends before its packet table", cut},
      {field_at, "the header has a wrong position for the packet table", far},
      {field_at, "the header has a wrong position for the packet table", near}};
  for (const auto& fault : faults) {
    const TemporaryFile file(fault.bytes);
    AedatPlayer player(file.source());
    ASSERT_TRUE(player.play()) << player.error;
    ASSERT_EQ(player.warnings.size(), 1U);
    EXPECT_TRUE(player.warnings.front().starts_with("Corrupt data at byte " +
                                                    std::to_string(fault.at) + ": " + fault.what))
        << player.warnings.front();
    EXPECT_TRUE(player.track("events_0").events == events);
    EXPECT_EQ(player.stat("corrupt-places"), 1U);
  }
}

TEST(AedatDemux, SaysWhereSomethingIsNotAedat) {
  const Bytes png{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n', 0, 0, 0, 13, 'I', 'H', 'D', 'R'};
  Bytes old;
  aedat_files::add(old, "#!AER-DAT1.1\r\n#\r\n");
  Bytes half = aedat4_file(steady_events(1'000, 10));
  half.resize(40);
  for (const auto& bytes : {png, old, half, Bytes{}, Bytes{'#'}}) {
    const TemporaryFile file(bytes);
    for (const char* between : {"", "identity ! "}) {
      AedatPlayer player(file.source() + between);
      EXPECT_FALSE(player.play());
      EXPECT_NE(player.error.find("AEDAT"), std::string::npos) << player.error;
      EXPECT_EQ(player.pads(), 0U);
    }
  }
}

/// What decodebin ends a file with.
GstMessageType decoded(const TemporaryFile& file, const std::string& between = "") {
  Player player(file.source() + between + "decodebin caps=application/x-event-camera,format=XYTP");
  player.play();
  return player.end;
}

/// decodebin drops errors while it is adding an element, whose state it locks.
TEST(AedatDemux, TellsDecodebinOfErrors) {
  auto bytes = aedat4_file(steady_events(100'000, 70));
  bytes[17] = 0x7f;  // the size of the header
  const TemporaryFile file(bytes);
  for (int i = 0; i < 30; ++i) {
    ASSERT_EQ(decoded(file), GST_MESSAGE_ERROR) << i;
    ASSERT_EQ(decoded(file, "queue ! "), GST_MESSAGE_ERROR) << i;
  }

  Pipeline pipeline(file.source() + "aedatdemux name=d");
  const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  gst_element_set_locked_state(pipeline["d"], TRUE);
  pipeline.set(GST_STATE_PAUSED);
  gst_element_set_state(pipeline["d"], GST_STATE_PAUSED);
  EXPECT_FALSE(Owned<GstMessage>(
      gst_bus_timed_pop_filtered(bus.get(), 50 * GST_MSECOND, GST_MESSAGE_ERROR)));
  gst_element_set_locked_state(pipeline["d"], FALSE);
  EXPECT_FALSE(pipeline.wait());
  EXPECT_EQ(pipeline.end, GST_MESSAGE_ERROR);
}

TEST(AedatDemux, SaysWhereAFileHasNoEvents) {
  const TemporaryFile empty(aedat_files::aedat4_header(""));
  AedatPlayer player(empty.source());
  EXPECT_FALSE(player.play());
  EXPECT_NE(player.error.find("neither events nor frames"), std::string::npos) << player.error;
  // There is a stream of events here, though it is empty.
  const TemporaryFile silent(aedat4_file({}));
  AedatPlayer other(silent.source());
  EXPECT_TRUE(other.play()) << other.error;
  EXPECT_EQ(other.track("events_0").eos, 1U);
}

}  // namespace
