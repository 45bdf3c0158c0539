// SPDX-License-Identifier: LGPL-2.1-or-later
// Cycles every element through its states repeatedly, with and without data.
#include "tests/elements/element_lines.hpp"

namespace {

using namespace harness;

class EverySimulator : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, EverySimulator, testing::ValuesIn(simulators));

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

TEST_P(EverySimulator, PlaysAgainAfterAStop) {
  Pipeline pipeline(
      "videotestsrc name=source pattern=ball num-buffers=6 ! video/x-raw,width=80,height=60 ! " +
      with_upload(GetParam()) + " ! fakesink name=sink signal-handoffs=true");
  int buffers = 0;
  g_signal_connect(pipeline["sink"], "handoff",
                   G_CALLBACK(+[](GstElement*, GstBuffer*, GstPad*, int* count) { ++*count; }),
                   &buffers);
  for (int times = 1; times <= 3; ++times) {
    ASSERT_TRUE(pipeline.play()) << pipeline.error;
    pipeline.set(GST_STATE_NULL);
    EXPECT_EQ(buffers, 5 * times);
  }
}

TEST_P(EverySimulator, IsFreedWhileInUse) {
  for (int frames = 0; frames < 4; ++frames) {
    bool freed = false;
    {
      Harness h(GetParam());
      tell_when_freed(h.element(), freed);
      h.caps("video/x-raw, format=GRAY8, width=32, height=24, framerate=25/1");
      for (int i = 0; i < frames; ++i) h.push(h.flat(i * 40 * GST_MSECOND, 60 * i));
    }
    EXPECT_TRUE(freed) << frames;
  }
}

}  // namespace
