// SPDX-License-Identifier: LGPL-2.1-or-later
// The simulators on the GPU: against those on the CPU, and how they find OpenGL.
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES3/gl31.h>
#include <gst/gl/gl.h>
#include <gst/gl/gstglfuncs.h>

#include <atomic>
#include <cmath>
#include <numeric>
#include <string_view>

#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;

constexpr const char* video = "video/x-raw, format=GRAY8, width=32, height=24, framerate=25/1";

class EveryFormat : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryFormat,
                         testing::ValuesIn(video_formats("gleventsim-frame", "sink")),
                         [](const auto& format) { return format.param; });

/// A video whose frames differ, pushed one by one.
struct Flashes {
  GstFlowReturn push() { return h.push(frame()); }
  GstBuffer* frame() {
    ++count;
    return h.flat(static_cast<GstClockTime>(count) * 40 * GST_MSECOND, count % 2 * 100);
  }

  Harness& h;
  int count = 0;
};

/// The buffers that come before the stream has ended; a GPU may still work on the last one until
/// then.
std::vector<std::string> outputs_until_eos(Harness& h) {
  push_eos(h.get());
  std::vector<std::string> outputs;
  while (const auto output = h.pull()) outputs.push_back(bytes_of(output.get()));
  return outputs;
}

std::string joined(const std::vector<std::string>& outputs) {
  return std::accumulate(outputs.begin(), outputs.end(), std::string());
}

/// Bytes of the output for five noisy frames.
std::string output_of_noise(Harness&& h, const std::string& format,
                            const std::string& out = GST_EVENT_CAMERA_MEDIA_TYPE) {
  h.caps("video/x-raw, width=46, height=34, framerate=25/1, format=" + format, out);
  GRand* random = g_rand_new_with_seed(7);
  for (GstClockTime i = 0; i < 5; ++i) {
    GstBuffer* frame = h.flat(i * 40 * GST_MSECOND, 0);
    GstMapInfo map;
    gst_buffer_map(frame, &map, GST_MAP_WRITE);
    for (gsize byte = 0; byte < map.size; ++byte)
      map.data[byte] = static_cast<guint8>(g_rand_int(random));
    gst_buffer_unmap(frame, &map);
    EXPECT_EQ(h.push(frame), GST_FLOW_OK);
  }
  g_rand_free(random);
  return joined(outputs_until_eos(h));
}

TEST_P(EveryFormat, GivesTheEventsOfTheCpuBitForBit) {
  const auto expected = output_of_noise(Harness("eventsim-frame"), GetParam());
  EXPECT_GT(expected.size(), 8U * 1000);
  EXPECT_EQ(output_of_noise(Harness("gleventsim-frame"), GetParam()), expected);
  EXPECT_EQ(output_of_noise(without_upload("gleventsim-frame"), GetParam()), expected);
}

TEST(Pictures, EqualTheCpuBitForBit) {
  for (const char* palette : {"dark", "light", "viridis"}) {
    const std::string options =
        std::string("eventsim-frame positive-threshold=60 palette=") + palette;
    const auto expected = output_of_noise(Harness(options), "GRAY8", pictures_of("eventsim-frame"));
    EXPECT_EQ(expected.size(), 5U * 46 * 34 * 4);
    const auto pictures = pictures_of("gleventsim-frame");
    EXPECT_EQ(output_of_noise(Harness("gl" + options), "GRAY8", pictures), expected) << palette;
    EXPECT_EQ(output_of_noise(without_upload("gl" + options), "GRAY8", pictures), expected);
  }
}

TEST(Pictures, HaveASyncPoint) {
  Harness h("gleventsim-frame");
  h.caps(video, pictures_of("gleventsim-frame"));
  h.push(h.flat(0, 100));
  const auto picture = h.pull();
  ASSERT_TRUE(picture);
  EXPECT_NE(gst_buffer_get_gl_sync_meta(picture.get()), nullptr);
}

/// Bytes of the events of a pattern that moves.
std::string events_of_motion(const std::string& element) {
  Harness h(element);
  h.caps("video/x-raw, width=62, height=46, framerate=25/1, format=GRAY8");
  for (int i = 0; i < 4; ++i) {
    h.push(h.frame(static_cast<GstClockTime>(i) * 40 * GST_MSECOND, [i](int x, int y) {
      return static_cast<int>(128 + 60 * std::sin(0.4 * (x - 2 * i)) + 60 * std::cos(0.3 * y));
    }));
  }
  return joined(outputs_until_eos(h));
}

TEST(Dense, InterpolatesAsSet) {
  for (const std::string setting : {"forward", "blend"}) {
    const auto found = events_of_motion("gleventsim-dense interpolation=" + setting).size();
    const auto expected =
        events_of_motion("eventsim-dense flow=farneback interpolation=" + setting).size();
    EXPECT_GT(expected, 8U * 10'000);
    EXPECT_NEAR(static_cast<double>(found), static_cast<double>(expected),
                0.001 * static_cast<double>(expected))
        << setting;
  }
}

TEST(OpenGl, IsSharedWithThePipeline) {
  Pipeline pipeline("videotestsrc num-buffers=3 ! gleventsim-frame name=it ! fakesink");
  EXPECT_TRUE(pipeline.reaches(GST_STATE_READY));
  for (GstElement* holder : {pipeline.get(), pipeline["it"]}) {
    GstContext* context = gst_element_get_context(holder, "gst.gl.GLDisplay");
    ASSERT_NE(context, nullptr) << GST_OBJECT_NAME(holder);
    gst_context_unref(context);
  }
  EXPECT_TRUE(pipeline.play()) << pipeline.error;
}

TEST(OpenGl, KeepsFramesAndPicturesInTextures) {
  Pipeline pipeline(
      "videotestsrc num-buffers=3 ! video/x-raw,format=NV12 ! glupload ! gleventsim-frame name=it "
      "! "
      "video/x-raw(memory:GLMemory) ! fakesink");
  EXPECT_TRUE(pipeline.reaches(GST_STATE_PAUSED)) << pipeline.error;
  for (const char* name : {"sink", "src"}) {
    const Owned<GstCaps> caps(gst_pad_get_current_caps(static_pad(pipeline["it"], name).get()));
    EXPECT_TRUE(gst_caps_features_contains(gst_caps_get_features(caps.get(), 0),
                                           GST_CAPS_FEATURE_MEMORY_GL_MEMORY))
        << name;
  }
}

TEST(OpenGl, SharesWhatItDrawsWithTheApplication) {
  Pipeline pipeline(
      "videotestsrc num-buffers=2 ! gleventsim-frame name=it ! video/x-raw(memory:GLMemory) ! "
      "fakesink name=sink");
  GstElement* const element = pipeline["it"];
  gst_element_set_state(element, GST_STATE_READY);
  GstContext* display = gst_element_get_context(element, GST_GL_DISPLAY_CONTEXT_TYPE);
  ASSERT_NE(display, nullptr);
  gst_element_set_state(element, GST_STATE_NULL);
  GstGLDisplay* of_application = nullptr;
  gst_context_get_gl_display(display, &of_application);
  GstGLContext* application = nullptr;
  ASSERT_TRUE(gst_gl_display_create_context(of_application, nullptr, &application, nullptr));

  const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  gst_bus_set_sync_handler(
      bus.get(),
      [](GstBus*, GstMessage* message, gpointer data) {
        const gchar* type = nullptr;
        if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_NEED_CONTEXT &&
            gst_message_parse_context_type(message, &type) &&
            std::string_view(type) == "gst.gl.app_context") {
          GstContext* context = gst_context_new(type, TRUE);
          gst_structure_set(gst_context_writable_structure(context), "context", GST_TYPE_GL_CONTEXT,
                            data, nullptr);
          gst_element_set_context(GST_ELEMENT(GST_MESSAGE_SRC(message)), context);
          gst_context_unref(context);
        }
        return GST_BUS_PASS;
      },
      application, nullptr);
  EXPECT_TRUE(pipeline.reaches(GST_STATE_PAUSED));
  GstSample* sample = nullptr;
  g_object_get(pipeline["sink"], "last-sample", &sample, nullptr);
  ASSERT_NE(sample, nullptr);
  GstMemory* picture = gst_buffer_peek_memory(gst_sample_get_buffer(sample), 0);
  EXPECT_TRUE(gst_gl_context_can_share(GST_GL_BASE_MEMORY_CAST(picture)->context, application));
  gst_sample_unref(sample);
  pipeline.set(GST_STATE_NULL);
  gst_bus_set_sync_handler(bus.get(), nullptr, nullptr, nullptr);
  gst_object_unref(application);
  gst_object_unref(of_application);
  gst_context_unref(display);
}

std::atomic<int> activations = 0;  ///< how often a thread made a context current

void count_activations() {
  { Harness("gleventsim-frame").caps(video); }  // GStreamer registers the type of contexts
  static gboolean (*activate)(GstGLContext*, gboolean) = nullptr;
  auto* contexts =
      static_cast<GstGLContextClass*>(g_type_class_ref(g_type_from_name("GstGLContextEGL")));
  if (activate != nullptr) return;
  activate = contexts->activate;
  contexts->activate = [](GstGLContext* context, gboolean current) -> gboolean {
    ++activations;
    return activate(context, current);
  };
}

/// It stays current while they play.
TEST(OpenGl, IsOneContextForAllCamerasOfAPipeline) {
  count_activations();
  std::string launch;
  for (int i = 0; i < 16; ++i)
    launch +=
        " videotestsrc num-buffers=5 ! video/x-raw,width=64,height=48 ! gleventsim-frame ! "
        "fakesink sync=false name=events" +
        std::to_string(i);
  {
    Pipeline pipeline(launch);
    EXPECT_TRUE(pipeline.reaches(GST_STATE_PAUSED)) << pipeline.error;
    activations = 0;
    EXPECT_TRUE(pipeline.play()) << pipeline.error;
    EXPECT_EQ(activations, 0);
    GstGLContext* first = nullptr;
    gst_gl_query_local_gl_context(pipeline["events0"], GST_PAD_SINK, &first);
    ASSERT_NE(first, nullptr);
    for (int i = 1; i < 16; ++i) {
      GstGLContext* other = nullptr;
      gst_gl_query_local_gl_context(pipeline[("events" + std::to_string(i)).c_str()], GST_PAD_SINK,
                                    &other);
      EXPECT_EQ(other, first) << i;
      gst_clear_object(&other);
    }
    gst_object_unref(first);
  }
  EXPECT_GT(activations, 0);  // at the end of the context
}

TEST(OpenGl, IsNamedInAnErrorWhereItIsMissing) {
  // Neither a screen nor a device, in a process of its own.
  const auto run = [] {
    g_setenv("GST_GL_PLATFORM", "egl", TRUE);
    g_setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere", TRUE);
    gst_init(nullptr, nullptr);
    const Owned<GstElement> element(gst_element_factory_make("gleventsim-frame", nullptr));
    const Owned<GstBus> bus(gst_bus_new());
    gst_element_set_bus(element.get(), bus.get());
    const bool refused =
        gst_element_set_state(element.get(), GST_STATE_READY) == GST_STATE_CHANGE_FAILURE;
    const Owned<GstMessage> error(gst_bus_pop_filtered(bus.get(), GST_MESSAGE_ERROR));
    g_printerr("refused=%d: %s\n", refused, error ? text_of(error.get()).c_str() : "no error");
    gst_element_set_bus(element.get(), nullptr);
    std::_Exit(0);
  };
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(run(), testing::ExitedWithCode(0),
              "refused=1: OpenGL does not work here: .* Use eventsim-frame, which runs on the "
              "CPU\\.");
}

std::atomic<bool> is_lost = false;
std::atomic<GstGLContext*> lost = nullptr;     ///< or only this one
std::atomic<GstGLContext*> current = nullptr;  ///< at the last look for errors
std::atomic<bool> has_ended = false;
std::atomic<bool> is_busy = false;
std::atomic<int> waits = 0;  ///< for the GPU, not in the thread of a context

/// Makes all contexts of the process report that they are lost where `is_lost`, and that the GPU is
/// not done where `is_busy`, unless they wait for it.
void take_over_contexts() {
  { Harness("gleventsim-frame").caps(video); }  // GStreamer registers the type of contexts
  static gpointer (*get_proc_address)(GstGLAPI, const gchar*) = nullptr;
  static GLenum (*get_error)();
  static PFNEGLCLIENTWAITSYNCKHRPROC wait_for;
  auto* contexts =
      static_cast<GstGLContextClass*>(g_type_class_ref(g_type_from_name("GstGLContextEGL")));
  if (get_proc_address != nullptr) return;
  get_proc_address = contexts->get_proc_address;
  contexts->get_proc_address = [](GstGLAPI api, const gchar* name) -> gpointer {
    const gpointer function = get_proc_address(api, name);
    if (std::string_view(name) == "glGetError") {
      get_error = reinterpret_cast<GLenum (*)()>(function);
      return reinterpret_cast<gpointer>(+[]() -> GLenum {
        constexpr GLenum context_lost = 0x0507;
        current = gst_gl_context_get_current();
        return is_lost || current == lost ? context_lost : get_error();
      });
    }
    if (std::string_view(name) == "eglClientWaitSyncKHR") {
      wait_for = reinterpret_cast<PFNEGLCLIENTWAITSYNCKHRPROC>(function);
      return reinterpret_cast<gpointer>(
          +[](EGLDisplay display, EGLSyncKHR sync, EGLint flags, EGLTimeKHR timeout) -> EGLint {
            if (is_busy && timeout == 0) return EGL_TIMEOUT_EXPIRED_KHR;
            waits += timeout > 0 && gst_gl_context_get_current() == nullptr;
            return wait_for(display, sync, flags, timeout);
          });
    }
    return function;
  };
}

/// Frames, the GPU being busy, whose intervals are known from when it is not.
class Busy : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    take_over_contexts();
    is_busy = false;
    Harness idle(GetParam());
    gst_harness_set_live(h.get(), FALSE);
    idle.caps(video);
    for (int i = 0; i < 6; ++i) idle.push(frame(idle, i));
    intervals = outputs_until_eos(idle);
    ASSERT_EQ(intervals.size(), 5U);
    is_busy = true;
    h.caps(video);
    push(0);
    EXPECT_EQ(waits, 0);
    push(1);
    EXPECT_FALSE(h.pull());
    EXPECT_EQ(waits, 1);  // for the first frame
    waits = 0;
  }
  void TearDown() override { is_busy = false; }

  static GstBuffer* frame(const Harness& of, int i) {
    GstBuffer* made =
        of.frame(time_of(i), [i](int x, int y) { return (x * 9 + y * 5 + i * 40) % 256; });
    if (i == 0) GST_BUFFER_FLAG_SET(made, GST_BUFFER_FLAG_DISCONT);
    return made;
  }
  static GstClockTime time_of(int i) { return static_cast<GstClockTime>(i) * 40 * GST_MSECOND; }

  void push(int i) {
    waits = 0;
    EXPECT_EQ(h.push(frame(h, i)), GST_FLOW_OK);
  }

  /// Expects interval i to be the next output. In the first one after a restart, eventsim-diff has
  /// nothing to follow yet.
  void expect_interval(std::size_t i, const Buffer& output, bool is_first = false) const {
    ASSERT_TRUE(output);
    EXPECT_EQ(GST_BUFFER_PTS(output.get()), time_of(static_cast<int>(i)));
    if (is_first && GetParam() == std::string_view("gleventsim-diff")) return;
    EXPECT_TRUE(bytes_of(output.get()) == intervals[i]);
  }

  std::vector<std::string> intervals;
  Harness h{GetParam()};
};
INSTANTIATE_TEST_SUITE_P(, Busy,
                         testing::Values("gleventsim-frame", "gleventsim-dense",
                                         "gleventsim-sparse", "gleventsim-diff"));

TEST_P(Busy, IntervalsAreReadWhenTheNextFrameHasBeenQueued) {
  for (int i = 2; i < 6; ++i) {
    push(i);
    EXPECT_EQ(waits, 1);  // for the interval before
    const auto output = h.pull();
    expect_interval(static_cast<std::size_t>(i - 2), output);
    EXPECT_EQ(GST_BUFFER_FLAG_IS_SET(output.get(), GST_BUFFER_FLAG_DISCONT), i == 2);
    EXPECT_FALSE(h.pull());
  }
  push_eos(h.get());
  expect_interval(4, h.pull());
  EXPECT_TRUE(h.pull_event(GST_EVENT_EOS));
}

TEST_P(Busy, IntervalsOfALiveStreamNeedNoFurtherFrame) {
  Harness live(GetParam());
  live.caps(video);
  for (int i = 0; i < 6; ++i) {
    live.push(frame(live, i));
    if (i > 0) expect_interval(static_cast<std::size_t>(i - 1), live.pull());
  }
  EXPECT_EQ(gst_harness_query_latency(live.get()), 40 * GST_MSECOND);
}

TEST_P(Busy, IntervalsComeBeforeWhatFollowsThem) {
  push_gap(h.get(), time_of(1), 80 * GST_MSECOND);
  expect_interval(0, h.pull());
  GstBuffer* discontinuous = frame(h, 4);
  GST_BUFFER_FLAG_SET(discontinuous, GST_BUFFER_FLAG_DISCONT);
  h.push(discontinuous);
  push(5);
  EXPECT_FALSE(h.pull());
  gst_harness_set_src_caps_str(h.get(),
                               "video/x-raw, format=GRAY8, width=16, height=16, framerate=25/1");
  const auto output = h.pull();
  expect_interval(4, output, true);
  EXPECT_TRUE(GST_BUFFER_FLAG_IS_SET(output.get(), GST_BUFFER_FLAG_DISCONT));
  EXPECT_TRUE(contains(h.out_caps(), "width=(int)16"));
}

TEST_P(Busy, IntervalsAreDroppedByAFlush) {
  flush({h.get()});
  push_segment(h.get());
  is_busy = false;
  push(1);
  push(2);
  h.wait_for_events();
  expect_interval(1, h.pull(), true);
  EXPECT_FALSE(h.pull());
}

TEST_P(Busy, IntervalsAreDroppedAtStop) {
  gst_element_set_state(h.element(), GST_STATE_READY);
  gst_element_set_state(h.element(), GST_STATE_NULL);
  EXPECT_EQ(waits, 0);
}

TEST_P(Busy, DownstreamErrorsReachUpstreamAtTheNextFrame) {
  gst_pad_add_probe(
      h->sinkpad, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo* info, gpointer) {
        GST_PAD_PROBE_INFO_FLOW_RETURN(info) = GST_FLOW_EOS;
        gst_buffer_unref(GST_PAD_PROBE_INFO_BUFFER(info));
        return GST_PAD_PROBE_HANDLED;
      },
      nullptr, nullptr);
  push_custom(h.get());
  EXPECT_EQ(h.push(frame(h, 2)), GST_FLOW_EOS);
}

TEST(OpenGl, IsAnErrorWhereItsContextIsLost) {
  take_over_contexts();
  for (const std::string element : gpu_simulators) {
    for (const std::string& out :
         {std::string(GST_EVENT_CAMERA_MEDIA_TYPE), pictures_of(element)}) {
      Harness h(element);
      h.caps(video, out);
      Flashes flashes{h};
      EXPECT_EQ(flashes.push(), GST_FLOW_OK);
      EXPECT_EQ(flashes.push(), GST_FLOW_OK);
      is_lost = true;
      EXPECT_EQ(flashes.push(), GST_FLOW_ERROR);
      is_lost = false;
      EXPECT_TRUE(contains(h.error(), "Use " + element.substr(2) + ", which runs on the CPU."));
      EXPECT_EQ(flashes.push(), GST_FLOW_OK);  // starts over, if the application goes on
    }
  }
}

/// Events or drawn events of flashes, in contexts that have been taken over.
class EitherOutput : public testing::TestWithParam<bool> {
 protected:
  EitherOutput() {
    take_over_contexts();
    gst_harness_set_live(h.get(), FALSE);
    h.caps(video, GetParam() ? pictures_of("gleventsim-frame") : GST_EVENT_CAMERA_MEDIA_TYPE);
  }

  Harness h = without_upload("gleventsim-frame");
  Flashes flashes{h};
};

INSTANTIATE_TEST_SUITE_P(, EitherOutput, testing::Bool(),
                         [](const auto& draws) { return draws.param ? "Pictures" : "Events"; });

TEST_P(EitherOutput, IsFoundAnewAfterALoss) {
  EXPECT_EQ(flashes.push(), GST_FLOW_OK);
  lost = GST_GL_CONTEXT(gst_object_ref(current.load()));  // so that no other has its address
  EXPECT_EQ(flashes.push(), GST_FLOW_ERROR);
  EXPECT_EQ(flashes.push(), GST_FLOW_OK);
  EXPECT_EQ(flashes.push(), GST_FLOW_OK);
  EXPECT_NE(current, lost);
  gst_object_unref(lost.exchange(nullptr));
}

/// Pretends, while it exists, that the threads of all contexts have ended.
class EndOfThreads {
 public:
  EndOfThreads() {
    static void (*send)(GstGLWindow*, GstGLWindowCB, gpointer) = nullptr;
    GstGLWindow* window = gst_gl_context_get_window(current);
    auto& send_message = GST_GL_WINDOW_GET_CLASS(window)->send_message;
    if (send == nullptr)
      send = std::exchange(send_message, [](GstGLWindow* to, GstGLWindowCB run, gpointer data) {
        if (!has_ended) send(to, run, data);
      });
    gst_object_unref(window);
    has_ended = true;
  }
  ~EndOfThreads() { has_ended = false; }
};

TEST(OpenGl, IsAnErrorWhereItsThreadHasEnded) {
  take_over_contexts();
  Harness h("gleventsim-frame");
  gst_harness_set_live(h.get(), FALSE);
  h.caps(video);
  is_busy = true;
  h.push(h.flat(0, 0));
  h.push(h.flat(40 * GST_MSECOND, 100));
  {
    const EndOfThreads end;
    push_eos(h.get());
  }
  is_busy = false;
  EXPECT_TRUE(contains(h.error(), "the OpenGL context was destroyed"));
  EXPECT_TRUE(h.pull_event(GST_EVENT_EOS));
}

TEST_P(EitherOutput, IsNotMistakenForTheFrameWhereItHasEnded) {
  EXPECT_EQ(flashes.push(), GST_FLOW_OK);
  {
    const EndOfThreads end;
    EXPECT_EQ(flashes.push(), GST_FLOW_ERROR);
  }
  EXPECT_TRUE(contains(h.error(), "the OpenGL context was destroyed"));
  EXPECT_EQ(flashes.push(), GST_FLOW_OK);
}

TEST_P(EitherOutput, HoldsFramesUntilItHasReadThem) {
  for (int i = 0; i < 3; ++i) {
    GstBuffer* const frame = flashes.frame();
    bool is_held = true;
    gst_mini_object_weak_ref(
        GST_MINI_OBJECT(frame),
        +[](gpointer held, GstMiniObject*) { *static_cast<bool*>(held) = false; }, &is_held);
    is_busy = true;
    EXPECT_EQ(h.push(frame), GST_FLOW_OK);
    EXPECT_TRUE(is_held) << i;
    is_busy = false;
    push_custom(h.get());
    EXPECT_FALSE(is_held) << i;
  }
}

/// Gives a pipeline a display of its own, without a screen. The pipeline holds it.
GstGLDisplay* give_display(GstElement* pipeline) {
  GstGLDisplay* display = gst_gl_display_new_with_type(GST_GL_DISPLAY_TYPE_EGL_DEVICE);
  EXPECT_NE(display, nullptr);
  GstContext* context = gst_context_new(GST_GL_DISPLAY_CONTEXT_TYPE, TRUE);
  gst_context_set_gl_display(context, display);
  gst_object_unref(display);
  gst_element_set_context(pipeline, context);
  gst_context_unref(context);
  return display;
}

TEST(OpenGl, SwitchesToTheDisplayOfTheApplication) {
  Pipeline pipeline(
      "videotestsrc num-buffers=5 ! glupload ! gleventsim-frame ! fakesink name=sink sync=false");
  for (int times = 0; times < 2; ++times) {
    const GstGLDisplay* const display = give_display(pipeline.get());
    ASSERT_TRUE(pipeline.reaches(GST_STATE_PAUSED)) << pipeline.error;
    GstGLContext* used = nullptr;
    gst_gl_query_local_gl_context(pipeline["sink"], GST_PAD_SINK, &used);
    ASSERT_NE(used, nullptr);
    EXPECT_EQ(used->display, display);
    gst_object_unref(used);
    EXPECT_TRUE(pipeline.play()) << pipeline.error;
    ASSERT_TRUE(pipeline.reaches(GST_STATE_READY));
  }
}

/// gldownload passes textures on where nobody maps them; here, those of another display.
TEST(OpenGl, UploadsTexturesThatItCannotUse) {
  Pipeline source(
      "gltestsrc num-buffers=3 ! video/x-raw(memory:GLMemory),width=64,height=48 ! gldownload ! "
      "video/x-raw ! fakesink name=sink sync=false");
  std::vector<Buffer> frames;
  watch(GST_BASE_SINK_PAD(source["sink"]),
        {[&](GstBuffer* buffer) { frames.emplace_back(gst_buffer_ref(buffer)); }});
  give_display(source.get());
  ASSERT_TRUE(source.play()) << source.error;
  ASSERT_EQ(frames.size(), 3U);
  Harness h = without_upload("gleventsim-frame");
  h.caps("video/x-raw, format=RGBA, width=64, height=48, framerate=30/1");
  for (const auto& frame : frames) {
    EXPECT_TRUE(gst_is_gl_memory(gst_buffer_peek_memory(frame.get(), 0)));
    EXPECT_EQ(h.push(gst_buffer_ref(frame.get())), GST_FLOW_OK);
  }
  EXPECT_EQ(h.error(), "");
}

}  // namespace
