// SPDX-License-Identifier: LGPL-2.1-or-later
// What elements write to GStreamer's log.
#include <algorithm>
#include <mutex>
#include <string>
#include <vector>

#include "tests/elements/event_buffer.hpp"
#include "tests/elements/harness.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;

/// The log of a category, as long as this object lives.
class Log {
 public:
  struct Line {
    GstDebugLevel level;
    std::string text;
  };

  explicit Log(const std::string& category) : category_(category) {
    gst_init(nullptr, nullptr);
    gst_debug_remove_log_function(gst_debug_log_default);
    gst_debug_add_log_function(add, this, nullptr);
    gst_debug_set_threshold_for_name(category.c_str(), GST_LEVEL_LOG);
  }
  ~Log() {
    gst_debug_unset_threshold_for_name(category_.c_str());
    gst_debug_remove_log_function_by_data(this);
  }
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;

  /// Lines that contain `part`, in order.
  std::vector<Line> with(const std::string& part) {
    const std::lock_guard lock(mutex_);
    std::vector<Line> found;
    std::ranges::copy_if(lines_, std::back_inserter(found), [&](const Line& line) {
      return line.text.find(part) != std::string::npos;
    });
    return found;
  }

  /// The first of these lines is a warning, the others are of level LOG.
  void expect_one_warning(const std::string& part, std::size_t count) {
    const auto lines = with(part);
    ASSERT_EQ(lines.size(), count) << part;
    EXPECT_EQ(lines.front().level, GST_LEVEL_WARNING);
    for (std::size_t i = 1; i < count; ++i) EXPECT_EQ(lines[i].level, GST_LEVEL_LOG);
  }

 private:
  static void add(GstDebugCategory* category, GstDebugLevel level, const gchar*, const gchar*, gint,
                  GObject*, GstDebugMessage* message, gpointer log) {
    auto& self = *static_cast<Log*>(log);
    if (gst_debug_category_get_name(category) != self.category_) return;
    const std::lock_guard lock(self.mutex_);
    self.lines_.push_back({level, gst_debug_message_get(message)});
  }

  std::string category_;
  std::mutex mutex_;
  std::vector<Line> lines_;
};

TEST(Log, TellsWhereDataAreCorrupt) {
  Log log("eventreader");
  std::string table = "t,x,y,p\n";
  std::vector<std::size_t> corrupt;
  for (int t = 0; t < 15'000; ++t) {
    if (t % 5000 == 1) corrupt.push_back(table.size());
    table += t % 5000 == 1 ? "?\n" : std::to_string(20 * t) + ",1,1,1\n";
  }
  const TemporaryFile file(table);
  Pipeline pipeline(file.source() + "queue ! eventcsvdec width=8 height=8 ! fakesink");
  ASSERT_TRUE(pipeline.play()) << pipeline.error;
  log.expect_one_warning("Corrupt data at byte", 3);
  for (const auto at : corrupt)
    EXPECT_EQ(log.with("the last at byte " + std::to_string(at)).size(), 1) << at;
}

TEST(Log, TellsTheNumbersOfLatePackets) {
  std::vector<Buffer> packets;
  Harness pay("rtpeventpay max-latency=0 seqnum-offset=7");
  pay.caps("application/x-event-camera, format=XYTP, width=8, height=8", "application/x-rtp");
  for (const GstClockTime time : {1, 2})
    pay.push(buffer_of(time * GST_SECOND, {{0, 1, 1}}, GST_MSECOND));
  while (auto packet = pay.pull()) packets.push_back(std::move(packet));
  ASSERT_EQ(packets.size(), 2);
  for (const bool as_list : {false, true}) {
    Log log("rtpeventdepay");
    Harness h("rtpeventdepay");
    h.caps(
        "application/x-rtp, media=application, clock-rate=1000000, encoding-name=X-EVENT-CAMERA, "
        "width=8, height=8");
    GstBufferList* const list = gst_buffer_list_new();
    for (const auto index : {0U, 1U, 0U, 1U}) {
      gst_buffer_list_add(list, gst_buffer_ref(packets[index].get()));
      if (!as_list) h.push(gst_buffer_ref(packets[index].get()));
    }
    if (as_list)
      gst_pad_push_list(h->srcpad, list);
    else
      gst_buffer_list_unref(list);
    EXPECT_EQ(stat_of(h.element(), "late-packets"), 2);
    log.expect_one_warning("later ones arrived before it", 2);
    EXPECT_EQ(log.with("packet number 7").size(), 1);
    EXPECT_EQ(log.with("packet number 8").size(), 1);
  }
}

}  // namespace
