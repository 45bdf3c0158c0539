// SPDX-License-Identifier: LGPL-2.1-or-later
// Cycles every element through its states repeatedly, with and without data.
#include "tests/elements/element_lines.hpp"

namespace {

using namespace element_lines;
using namespace harness;

class EverySimulator : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, EverySimulator, testing::ValuesIn(simulators));

class AllStates : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, AllStates, testing::ValuesIn(element_names()), element_lines::test_name);

/// As GStreamer's generic tests of all elements do.
TEST_P(AllStates, AreReachedFromEachOther) {
  const auto element = Kind(GetParam()).make();
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

TEST_P(AllStates, AreLeftByAnElementThatIsFreed) {
  bool freed = false;
  {
    const auto pipeline = launched(Kind(GetParam()).launch_with_sources(1'000'000));
    const Owned<GstElement> element(gst_bin_get_by_name(GST_BIN(pipeline.get()), "it"));
    tell_when_freed(element.get(), freed);
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    EXPECT_EQ(gst_element_get_state(pipeline.get(), nullptr, nullptr, 60 * GST_SECOND),
              GST_STATE_CHANGE_SUCCESS);
    gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  }
  // A thread of the pipeline may still hold it.
  for (int i = 0; i < 500 && !freed; ++i) g_usleep(10'000);
  EXPECT_TRUE(freed);
}

}  // namespace
