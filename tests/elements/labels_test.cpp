// SPDX-License-Identifier: LGPL-2.1-or-later
// Labels of simulated events on their way: from eventsim-dvs to measures and files.
#include <array>
#include <span>
#include <string>
#include <vector>

#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;

const std::string noisy =
    "eventsim-dvs preset=davis346 shot-noise-rate=20 leak-rate=5 hot-pixels=0.01 "
    "exposure-pulse=0.05 exposure-lead=9000000 seed=3 ";

/// Frames of a ball that moves over noise-free grey.
std::vector<Buffer> simulated(const std::string& launch,
                              const std::string& out_caps = GST_EVENT_CAMERA_MEDIA_TYPE) {
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
  const auto plain = simulated(noisy);
  const auto labelled = simulated(noisy + "label=true");
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
    const auto buffers = simulated(noisy + (is_labelled ? "label=true" : ""));
    const auto expected = counts_of(buffers);
    Harness h("eventstats interval=0");
    h.caps("application/x-event-camera, format=XYTP, width=64, height=48");
    for (const auto& buffer : buffers) h.push(gst_buffer_ref(buffer.get()));
    push_eos(h.get());
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

void write(const std::vector<Buffer>& buffers, const std::string& writer) {
  Pipeline pipeline(
      "appsrc name=in format=time caps=\"application/x-event-camera, format=XYTP, width=64, "
      "height=48, framerate=0/1\" ! " +
      writer);
  GstFlowReturn flow = GST_FLOW_ERROR;
  for (const auto& buffer : buffers)
    g_signal_emit_by_name(pipeline["in"], "push-buffer", buffer.get(), &flow);
  g_signal_emit_by_name(pipeline["in"], "end-of-stream", &flow);
  ASSERT_TRUE(pipeline.play()) << pipeline.error;
}

TEST(Labels, AreReadBack) {
  const auto buffers = simulated(noisy + "label=true");
  guint16 object_class = 0;
  for (const auto& buffer : buffers) {
    auto* meta = gst_buffer_get_event_camera_label_meta(buffer.get());
    for (gsize i = 0; i < meta->n_labels; ++i) meta->labels[i].object_class = object_class += 31;
  }
  const TemporaryFile text;
  write(buffers, "eventcsvenc format=labels" + text.sink());
  const auto expected = text.bytes();
  ASSERT_GT(expected.size(), 10'000U);

  for (const auto& [encoder, decoder] : {std::pair("eventcsvenc format=labels", "eventcsvdec"),
                                         {"eventnpzenc", "eventnpzdec"},
                                         {"eventhdf5sink format=dsec", "eventhdf5dec"}}) {
    const TemporaryFile file;
    const bool is_sink = std::string(encoder).starts_with("eventhdf5sink");
    write(buffers, encoder + (is_sink ? " location=" + in_quotes(file.path()) : file.sink()));
    EXPECT_TRUE(copied(file, std::string(decoder) + " ! eventcsvenc format=labels") == expected)
        << decoder;
  }
}

}  // namespace
