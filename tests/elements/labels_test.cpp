// SPDX-License-Identifier: LGPL-2.1-or-later
// Labels of simulated events on their way: from eventsim-dvs to measures and files.
#include <array>
#include <numeric>
#include <string>
#include <vector>

#include "src/core/label.hpp"
#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;
using eventcamera::Cause;

const std::string noisy =
    "eventsim-dvs preset=davis346 shot-noise-rate=20 leak-rate=5 hot-pixels=0.01 "
    "exposure-pulse=0.05 exposure-lead=9000000 seed=3 ";

/// Frames of a ball that moves over noise-free grey.
std::vector<Buffer> simulated(const std::string& launch, const std::string& out_caps) {
  Harness h(launch);
  h.caps("video/x-raw, format=GRAY8, width=64, height=48, framerate=25/1", out_caps);
  std::vector<Buffer> buffers;
  for (int i = 0; i < 8; ++i) {
    h.push(h.frame(static_cast<GstClockTime>(i) * 40 * GST_MSECOND, [i](int x, int y) {
      return (x - 6 * i) * (x - 6 * i) + (y - 20) * (y - 20) < 100 ? 220 : 60;
    }));
    while (auto buffer = h.pull()) buffers.push_back(std::move(buffer));
  }
  return buffers;
}

using Counts = std::array<guint64, 6>;

Counts counts_of(const std::vector<Buffer>& buffers) {
  Counts counts{};
  for (const auto& buffer : buffers) {
    const auto* meta = gst_buffer_get_event_camera_label_meta(buffer.get());
    if (meta == nullptr) continue;
    for (gsize i = 0; i < meta->n_labels; ++i) ++counts.at(meta->labels[i].cause);
  }
  return counts;
}

constexpr std::array names = {"unknown-events",    "light-events",     "leak-events",
                              "shot-noise-events", "hot-pixel-events", "exposure-pulse-events"};

TEST(Labels, AreMadeOnRequestAndChangeNoEvent) {
  const auto plain = simulated(noisy, GST_EVENT_CAMERA_MEDIA_TYPE);
  const auto labelled = simulated(noisy + "label=true", GST_EVENT_CAMERA_MEDIA_TYPE);
  ASSERT_EQ(plain.size(), 7U);
  ASSERT_EQ(labelled.size(), plain.size());
  for (std::size_t i = 0; i < plain.size(); ++i) {
    EXPECT_EQ(bytes_of(labelled[i].get()), bytes_of(plain[i].get()));
    EXPECT_EQ(gst_buffer_get_event_camera_label_meta(plain[i].get()), nullptr);
    EXPECT_NE(gst_buffer_get_event_camera_label_meta(labelled[i].get()), nullptr);
  }
  const auto counts = counts_of(labelled);
  EXPECT_EQ(counts[0], 0U);
  for (const auto count : std::span(counts).subspan(1)) EXPECT_GT(count, 0U);
}

TEST(Labels, AreNotMadeForDrawnEvents) {
  const auto pictures = simulated(noisy, "video/x-raw, format=RGBA");
  const auto of_labelled = simulated(noisy + "label=true", "video/x-raw, format=RGBA");
  ASSERT_EQ(pictures.size(), 8U);
  ASSERT_EQ(of_labelled.size(), pictures.size());
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    EXPECT_EQ(bytes_of(of_labelled[i].get()), bytes_of(pictures[i].get()));
    EXPECT_EQ(gst_buffer_get_meta(of_labelled[i].get(), GST_EVENT_CAMERA_LABEL_META_API_TYPE),
              nullptr);
  }
}

TEST(Labels, AreCountedByEventstats) {
  for (const bool is_labelled : {true, false}) {
    const auto buffers =
        simulated(noisy + (is_labelled ? "label=true" : ""), GST_EVENT_CAMERA_MEDIA_TYPE);
    const auto expected = counts_of(buffers);
    Harness h("eventstats interval=0");
    h.caps("application/x-event-camera, format=XYTP, width=64, height=48");
    for (const auto& buffer : buffers) h.push(gst_buffer_ref(buffer.get()));
    gst_harness_push_event(h.get(), gst_event_new_eos());
    const auto message = h.message(GST_MESSAGE_ELEMENT);
    ASSERT_TRUE(message);
    const auto* figures = gst_message_get_structure(message.get());
    for (std::size_t i = 0; i < names.size(); ++i) {
      guint64 count = 0;
      EXPECT_EQ(gst_structure_get_uint64(figures, names[i], &count) != FALSE, is_labelled);
      EXPECT_EQ(count, expected.at(i)) << names[i];
    }
  }
}

/// Drops every third event of each buffer, and its label.
GstPadProbeReturn drop_some(GstPad*, GstPadProbeInfo* info, gpointer) {
  auto* buffer = gst_buffer_make_writable(GST_PAD_PROBE_INFO_BUFFER(info));
  GST_PAD_PROBE_INFO_DATA(info) = buffer;
  auto* meta = gst_buffer_get_event_camera_label_meta(buffer);
  auto events = events_of(buffer);
  const auto* const labels = reinterpret_cast<eventcamera::Label*>(meta->labels);
  const eventcamera::LabelledEvents all{
      {reinterpret_cast<eventcamera::Event*>(events.data()), events.size()},
      {const_cast<eventcamera::Label*>(labels), meta->n_labels}};
  int i = 0;
  const auto kept = all.keep_if([&](const eventcamera::Event&) { return i++ % 3 != 0; });
  gst_event_camera_label_meta_truncate(meta, kept.events.size());
  gst_buffer_remove_all_memory(buffer);
  const auto size = kept.events.size_bytes();
  gst_buffer_append_memory(buffer, gst_allocator_alloc(nullptr, size, nullptr));
  gst_buffer_fill(buffer, 0, kept.events.data(), size);
  return GST_PAD_PROBE_OK;
}

/// Adds the labels that pass.
GstPadProbeReturn count_labels(GstPad*, GstPadProbeInfo* info, gpointer sum) {
  std::vector<Buffer> one;
  one.emplace_back(gst_buffer_ref(GST_PAD_PROBE_INFO_BUFFER(info)));
  const auto counts = counts_of(one);
  auto& sums = *static_cast<Counts*>(sum);
  for (std::size_t i = 0; i < counts.size(); ++i) sums.at(i) += counts.at(i);
  return GST_PAD_PROBE_OK;
}

void add_probe(GstElement* element, const char* name, GstPadProbeCallback probe, gpointer data) {
  GstPad* pad = gst_element_get_static_pad(element, name);
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, probe, data, nullptr);
  gst_object_unref(pad);
}

TEST(Labels, TellEventcompareHowWellAFilterClassifies) {
  Pipeline pipeline(
      "eventcompare name=compare ! fakesink name=out  "
      "videotestsrc pattern=ball num-buffers=20 ! video/x-raw,width=64,height=48 ! " +
      noisy +
      "label=true name=dvs ! tee name=t  t. ! queue ! compare.reference  "
      "t. ! queue ! identity name=filter ! compare.candidate");
  Counts before{};
  Counts after{};
  add_probe(pipeline["dvs"], "src", count_labels, &before);
  add_probe(pipeline["filter"], "src", drop_some, nullptr);
  add_probe(pipeline["out"], "sink", count_labels, &after);
  Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  pipeline.set(GST_STATE_PLAYING);
  const Owned<GstMessage> message(gst_bus_timed_pop_filtered(
      bus.get(), 60 * GST_SECOND,
      static_cast<GstMessageType>(GST_MESSAGE_ELEMENT | GST_MESSAGE_ERROR)));
  ASSERT_TRUE(message);
  ASSERT_EQ(GST_MESSAGE_TYPE(message.get()), GST_MESSAGE_ELEMENT) << text_of(message.get());
  const auto* figures = gst_message_get_structure(message.get());
  const GValue* value = gst_structure_get_value(figures, "classification");
  ASSERT_NE(value, nullptr);
  const auto* found = gst_value_get_structure(value);
  const auto all_but_light = [](const Counts& counts) {
    return std::accumulate(counts.begin() + 2, counts.end(), guint64{0});
  };
  const auto count = [&](const char* name) {
    guint64 number = 0;
    EXPECT_TRUE(gst_structure_get_uint64(found, name, &number)) << name;
    return number;
  };
  const auto rate = [&](const char* name) {
    double number = 0;
    EXPECT_TRUE(gst_structure_get_double(found, name, &number)) << name;
    return number;
  };
  ASSERT_GT(after[1], 0U);
  EXPECT_LT(after[1], before[1]);
  EXPECT_EQ(count("true-positives"), after[1]);
  EXPECT_EQ(count("false-positives"), all_but_light(after));
  EXPECT_EQ(count("false-negatives"), before[1] - after[1]);
  EXPECT_EQ(count("true-negatives"), all_but_light(before) - all_but_light(after));
  EXPECT_NEAR(rate("true-positive-rate"), 2 / 3.0, 0.1);
  EXPECT_NEAR(rate("false-positive-rate"), 2 / 3.0, 0.1);
  EXPECT_DOUBLE_EQ(rate("precision"), static_cast<double>(after[1]) /
                                          static_cast<double>(after[1] + all_but_light(after)));
}

/// The bytes that follow a text.
std::string after(const std::string& text, const std::string& all) {
  const auto at = all.find(text);
  EXPECT_NE(at, std::string::npos) << text;
  return at == std::string::npos ? "" : all.substr(at + text.size());
}

TEST(Labels, AreWrittenAsColumns) {
  const auto buffers = simulated(noisy + "label=true", GST_EVENT_CAMERA_MEDIA_TYPE);
  std::string causes;
  std::string lines = "t,x,y,p,cause,class\n";
  for (const auto& buffer : buffers) {
    const auto* meta = gst_buffer_get_event_camera_label_meta(buffer.get());
    for (gsize i = 0; i < meta->n_labels; ++i) {
      const auto event = events_of(buffer.get())[i];
      causes += static_cast<char>(meta->labels[i].cause);
      lines += std::to_string(GST_BUFFER_PTS(buffer.get()) / 1000 + event.t) + "," +
               std::to_string(event.x) + "," + std::to_string(event.y_p & 0x7fff) + "," +
               std::to_string(event.y_p >> 15) + "," +
               std::to_string(static_cast<int>(meta->labels[i].cause)) + ",0\n";
    }
  }
  const auto written = [&](const std::string& launch) {
    Harness h(launch);
    h.caps("application/x-event-camera, format=XYTP, width=64, height=48", "ANY");
    for (const auto& buffer : buffers) h.push(gst_buffer_ref(buffer.get()));
    gst_harness_push_event(h.get(), gst_event_new_eos());
    std::string bytes;
    while (const auto buffer = h.pull()) bytes += bytes_of(buffer.get());
    return bytes;
  };
  EXPECT_EQ(written("eventcsvenc format=labels"), lines);
  // An archive holds its arrays as they are, after a header that ends a line.
  const auto npz = written("eventnpzenc");
  const auto column = after("\n", after("cause.npy", npz));
  EXPECT_EQ(column.substr(0, causes.size()), causes);
  const auto classes = after("\n", after("class.npy", npz));
  EXPECT_EQ(classes.substr(0, 2 * causes.size()), std::string(2 * causes.size(), '\0'));
}

/// A source of these buffers.
std::string source_of(const std::string& writer) {
  return "appsrc name=in format=time caps=\"application/x-event-camera, format=XYTP, "
         "width=64, height=48, framerate=0/1\" ! " +
         writer;
}

void play(Pipeline& pipeline, const std::vector<Buffer>& buffers) {
  GstFlowReturn flow = GST_FLOW_ERROR;
  for (const auto& buffer : buffers)
    g_signal_emit_by_name(pipeline["in"], "push-buffer", buffer.get(), &flow);
  g_signal_emit_by_name(pipeline["in"], "end-of-stream", &flow);
  ASSERT_TRUE(pipeline.play()) << pipeline.error;
}

TEST(Labels, AreReadBack) {
  const auto buffers = simulated(noisy + "label=true", GST_EVENT_CAMERA_MEDIA_TYPE);
  guint16 object_class = 0;
  for (const auto& buffer : buffers) {
    auto* meta = gst_buffer_get_event_camera_label_meta(buffer.get());
    for (gsize i = 0; i < meta->n_labels; ++i) meta->labels[i].object_class = object_class += 31;
  }
  const TemporaryFile text;
  Pipeline writer(source_of("eventcsvenc format=labels" + text.sink()));
  play(writer, buffers);
  const auto expected = text.bytes();
  ASSERT_GT(expected.size(), 10'000U);

  for (const auto& [encoder, decoder] : {std::pair("eventcsvenc format=labels", "eventcsvdec"),
                                         {"eventnpzenc", "eventnpzdec"},
                                         {"eventhdf5sink format=dsec", "eventhdf5dec"}}) {
    const TemporaryFile file;
    const bool is_sink = std::string(encoder).starts_with("eventhdf5sink");
    Pipeline encoding(
        source_of(encoder + (is_sink ? " location=" + in_quotes(file.path()) : file.sink())));
    play(encoding, buffers);
    EXPECT_TRUE(copied(file, std::string(decoder) + " ! eventcsvenc format=labels") == expected)
        << decoder;
  }
}

}  // namespace
