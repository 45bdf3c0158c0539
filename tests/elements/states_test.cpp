// SPDX-License-Identifier: LGPL-2.1-or-later
// Cycles every element through its states repeatedly, with and without data.
#include "tests/elements/element_lines.hpp"

namespace {

using namespace harness;

class EveryElement : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, EveryElement, testing::ValuesIn(elements));

class AllStates : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, AllStates, testing::ValuesIn(element_lines::element_names()),
                         element_lines::test_name);

/// As GStreamer's generic tests of all elements do.
TEST_P(AllStates, AreReachedFromEachOther) {
  const auto element = element_lines::Kind(GetParam()).make();
  const auto states = {GST_STATE_NULL, GST_STATE_READY, GST_STATE_PAUSED, GST_STATE_PLAYING};
  for (const auto from : states)
    for (const auto to : states)
      for (const auto state : {from, to, from})
        EXPECT_NE(gst_element_set_state(element.get(), state), GST_STATE_CHANGE_FAILURE)
            << gst_element_state_get_name(from) << " and " << gst_element_state_get_name(to);
  EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  EXPECT_EQ(GST_OBJECT_REFCOUNT_VALUE(element.get()), 1);
}

TEST_P(EveryElement, PlaysAgainAfterAStop) {
  gst_init(nullptr, nullptr);
  const std::string launch =
      "videotestsrc name=source pattern=ball num-buffers=6 ! video/x-raw,width=80,height=60 ! " +
      with_upload(GetParam()) + " ! fakesink name=sink signal-handoffs=true";
  Owned<GstElement> pipeline(gst_parse_launch(launch.c_str(), nullptr));
  ASSERT_TRUE(pipeline);
  int buffers = 0;
  Owned<GstElement> sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "sink"));
  g_signal_connect(sink.get(), "handoff",
                   G_CALLBACK(+[](GstElement*, GstBuffer*, GstPad*, int* count) { ++*count; }),
                   &buffers);
  Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  for (int times = 1; times <= 3; ++times) {
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    Owned<GstMessage> message(gst_bus_timed_pop_filtered(
        bus.get(), 20 * GST_SECOND,
        static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
    ASSERT_TRUE(message);
    EXPECT_EQ(GST_MESSAGE_TYPE(message.get()), GST_MESSAGE_EOS);
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
    EXPECT_EQ(buffers, 5 * times);
  }
}

TEST_P(EveryElement, IsFreedWhileInUse) {
  for (int frames = 0; frames < 4; ++frames) {
    bool freed = false;
    {
      Harness h(GetParam());
      g_object_weak_ref(
          G_OBJECT(h.element()),
          +[](gpointer was_freed, GObject*) { *static_cast<bool*>(was_freed) = true; }, &freed);
      h.caps("video/x-raw, format=GRAY8, width=32, height=24, framerate=25/1");
      for (int i = 0; i < frames; ++i) h.push(h.flat(i * 40 * GST_MSECOND, 60 * i));
    }
    EXPECT_TRUE(freed) << frames;
  }
}

}  // namespace
