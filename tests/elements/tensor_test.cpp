// SPDX-License-Identifier: LGPL-2.1-or-later
// eventtensor: windows, times, caps and content of tensors.

#include "features.hpp"
#include "src/core/event.hpp"
#include "src/tensor/event_tensor.hpp"
#include "tests/elements/pipeline.hpp"

#ifdef HAVE_TENSOR_META
#include <gst/analytics/analytics.h>
#endif

namespace {

using namespace harness;
using namespace eventcamera;

constexpr int width = 32;
constexpr int height = 24;
constexpr GstClockTime ms = GST_MSECOND;
const std::string events_caps =
    "application/x-event-camera, format=XYTP, width=32, height=24, framerate=100/1";

/// Two events in a column, a third and two thirds through an interval of 10 ms.
std::vector<Event> column(int x) {
  return {on(x, 1, 3'333), off(x, 2, 6'666)};
}

/// The bytes of the tensor of events at times from 0 on.
std::string tensor_of(const std::vector<AbsoluteEvent>& events, const TensorSettings& settings) {
  EventTensor tensor(width, height, settings);
  std::string bytes(tensor.bytes(), '\0');
  tensor.write(events, events.empty() ? 0 : events.back().t,
               reinterpret_cast<std::byte*>(bytes.data()));
  return bytes;
}

class Tensor : public testing::Test {
 protected:
  void begin(const std::string& settings, const std::string& caps = events_caps) {
    h.emplace("eventtensor " + settings);
    gst_harness_set_live(h->get(), FALSE);
    gst_harness_set_sink_caps_str(h->get(), "other/tensors");
    gst_harness_set_src_caps_str(h->get(), caps.c_str());
  }

  /// Pushes intervals of 10 ms with the columns `first` to `last`.
  void push_columns(int first, int last) {
    for (int i = first; i <= last; ++i) push_column(i, static_cast<GstClockTime>(i) * 10 * ms);
  }
  /// Pushes an interval of 10 ms, and keeps its events.
  void push_column(int x, GstClockTime start) {
    GstBuffer* const buffer = buffer_of(start, column(x), 10 * ms);
    append_events(buffer, events);
    EXPECT_EQ(h->push(buffer), GST_FLOW_OK);
  }

  void expect_tensor(GstClockTime pts, GstClockTime duration, std::size_t first, std::size_t last,
                     const TensorSettings& settings = {}) {
    const auto tensor = h->pull();
    ASSERT_TRUE(tensor);
    EXPECT_EQ(GST_BUFFER_PTS(tensor.get()), pts);
    EXPECT_EQ(GST_BUFFER_DURATION(tensor.get()), duration);
    const std::vector window(events.begin() + static_cast<std::ptrdiff_t>(first),
                             events.begin() + static_cast<std::ptrdiff_t>(last));
    EXPECT_TRUE(bytes_of(tensor.get()) == tensor_of(window, settings)) << pts;
  }

  std::optional<Harness> h;
  std::vector<AbsoluteEvent> events;
};

TEST_F(Tensor, IsOneOfEachBufferByDefault) {
  begin("");
  push_columns(0, 1);
  push_eos(h->get());
  expect_tensor(0, 10 * ms, 0, 2);
  expect_tensor(10 * ms, 10 * ms, 2, 4);
  EXPECT_FALSE(h->pull());
  const auto caps = h->out_caps();
  for (const char* field :
       {"other/tensors", "format=(string)static", "num_tensors=(int)1",
        "dimensions=(string)32:24:5:1", "types=(string)float32", "framerate=(fraction)100/1"})
    EXPECT_TRUE(contains(caps, field));
}

TEST_F(Tensor, HasTheSettings) {
  begin("representation=histogram data-type=uint8 normalization=max accumulation-time=25000000");
  push_columns(0, 4);
  const TensorSettings settings{.representation = eventcamera::Representation::histogram,
                                .normalization = eventcamera::Normalization::max,
                                .type = eventcamera::ElementType::uint8};
  expect_tensor(0, 25 * ms, 0, 5, settings);
  expect_tensor(25 * ms, 25 * ms, 5, 10, settings);
  EXPECT_TRUE(
      contains(h->out_caps(),
               "dimensions=(string)32:24:2:1, types=(string)uint8, framerate=(fraction)40/1"));
}

TEST_F(Tensor, EndsWithTheSegment) {
  begin("accumulation-time=25000000");
  push_columns(0, 0);
  end_segment(h->get(), 10 * ms);
  expect_tensor(0, 10 * ms, 0, 2);
}

TEST_F(Tensor, GoesOnThroughGaps) {
  begin("accumulation-time=10000000");
  push_columns(0, 0);
  push_gap(h->get(), 10 * ms, 20 * ms);
  push_columns(3, 3);
  expect_tensor(0, 10 * ms, 0, 2);
  expect_tensor(10 * ms, 10 * ms, 2, 2);
  expect_tensor(20 * ms, 10 * ms, 2, 2);
  expect_tensor(30 * ms, 10 * ms, 2, 4);
  EXPECT_FALSE(h->pull_event(GST_EVENT_GAP));
}

TEST_F(Tensor, IsNotMadeOfLongPauses) {
  begin("accumulation-time=10000000");
  constexpr GstClockTime day = 24 * 3600 * GST_SECOND;
  push_columns(0, 0);
  push_gap(h->get(), 10 * ms, day - 10 * ms);
  push_column(1, day);
  expect_tensor(0, 10 * ms, 0, 2);
  expect_tensor(10 * ms, 10 * ms, 2, 2);
  expect_tensor(day, 10 * ms, 2, 4);
  EXPECT_TRUE(contains(h->warning(), "The events pause"));
  EXPECT_EQ(h->warning(), "");
}

TEST_F(Tensor, IsOneOfAGapWhereWindowsAreBuffers) {
  begin("frame-count=2");
  push_columns(0, 0);
  push_gap(h->get(), 10 * ms, 10 * ms);
  expect_tensor(0, 20 * ms, 0, 2);
}

TEST_F(Tensor, StartsAtTheSegment) {
  begin("accumulation-time=10000000");
  push_segment(h->get(), {.start = 15 * ms});
  push_columns(0, 2);
  expect_tensor(15 * ms, 10 * ms, 3, 5);
  push_eos(h->get());
  expect_tensor(25 * ms, 5 * ms, 5, 6);
}

TEST_F(Tensor, StartsOverWhereTimeGoesBackOrLeaps) {
  begin("accumulation-time=20000000");
  push_columns(4, 4);
  push_columns(1, 2);
  expect_tensor(40 * ms, 10 * ms, 0, 2);
  expect_tensor(10 * ms, 20 * ms, 2, 6);
  const GstClockTime far = 100 * 3600 * GST_SECOND;
  h->push(buffer_of(far, column(0), 20 * ms));
  const auto tensor = h->pull();
  EXPECT_EQ(GST_BUFFER_PTS(tensor.get()), far);
  EXPECT_TRUE(GST_BUFFER_IS_DISCONT(tensor.get()));
}

TEST_F(Tensor, FollowsNewCaps) {
  begin("accumulation-time=20000000 representation=event-frame");
  push_columns(0, 0);
  gst_harness_set_src_caps_str(
      h->get(), "application/x-event-camera, format=XYTP, width=64, height=48, framerate=100/1");
  const TensorSettings settings{.representation = eventcamera::Representation::event_frame};
  expect_tensor(0, 10 * ms, 0, 2, settings);
  EXPECT_TRUE(contains(h->out_caps(), "dimensions=(string)64:48:1:1"));
}

TEST_F(Tensor, TellsWhatToSetForTheTensorsThatDownstreamWants) {
  const std::pair<const char*, const char*> wishes[] = {
      {"types=uint8", "types=uint8 (set data-type)"},
      {"dimensions=32:24:2:1", "(set representation or bins, or scale the events)"},
      {"types=float16, framerate=30/1", "30/1 (set accumulation-time, frame-count or overlap)"}};
  for (const auto& [caps, wish] : wishes) {
    h.emplace("eventtensor");
    gst_harness_set_sink_caps_str(h->get(), (std::string("other/tensors, ") + caps).c_str());
    gst_harness_set_src_caps_str(h->get(), events_caps.c_str());
    EXPECT_EQ(h->push(buffer_of(0, column(0), 10 * ms)), GST_FLOW_NOT_NEGOTIATED);
    EXPECT_TRUE(contains(h->error(), wish)) << wish;
    h->push(buffer_of(10 * ms, column(0), 10 * ms));
    EXPECT_EQ(h->error(), "") << "told again";
  }
}

/// The result of tensors in place of a GAP.
TEST_F(Tensor, ReturnsWhatDownstreamSaidOfAGap) {
  begin("accumulation-time=10000000");
  push_columns(0, 0);
  gst_pad_set_active((*h)->sinkpad, FALSE);
  EXPECT_FALSE(gst_harness_push_event(h->get(), gst_event_new_gap(10 * ms, 10 * ms)));
  gst_pad_set_active((*h)->sinkpad, TRUE);
  EXPECT_EQ(h->push(buffer_of(20 * ms, column(0), 10 * ms)), GST_FLOW_FLUSHING);
  EXPECT_EQ(h->push(buffer_of(20 * ms, column(0), 10 * ms)), GST_FLOW_OK);
}

TEST_F(Tensor, TakesALatencyOfItsWindow) {
  begin("accumulation-time=20000000");
  gst_harness_set_live(h->get(), TRUE);
  push_columns(0, 0);
  EXPECT_EQ(gst_harness_query_latency(h->get()), 20 * ms);
}

#ifdef HAVE_TENSOR_META
TEST_F(Tensor, DescribesItselfInAMeta) {
  begin("representation=histogram data-type=float16");
  push_columns(0, 0);
  const auto buffer = h->pull();
  auto* const meta = gst_buffer_get_tensor_meta(buffer.get());
  ASSERT_NE(meta, nullptr);
  ASSERT_EQ(meta->num_tensors, 1U);
  const GstTensor* const tensor = gst_tensor_meta_get(meta, 0);
  EXPECT_EQ(tensor->data_type, GST_TENSOR_DATA_TYPE_FLOAT16);
  EXPECT_EQ(tensor->dims_order, GST_TENSOR_DIM_ORDER_ROW_MAJOR);
  gsize count = 0;
  const gsize* const dimensions = gst_tensor_get_dims(const_cast<GstTensor*>(tensor), &count);
  EXPECT_EQ(std::vector<gsize>(dimensions, dimensions + count),
            (std::vector<gsize>{1, 2, height, width}));
  EXPECT_TRUE(bytes_of(tensor->data) == bytes_of(buffer.get()));
}
#endif

}  // namespace
