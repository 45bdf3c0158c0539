// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/check/gstharness.h>
#include <gst/video/video.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <initializer_list>
#include <memory>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "gst/eventcamera/eventcamera.h"

/// Quotes a path for a launch line; it may contain blanks.
inline std::string in_quotes(const std::string& path) {
  return '"' + path + '"';
}

/// Number of repetitions of a test that finds more the longer it runs: `soak` in ./tests/run soak,
/// else `usual`, or a quarter of it under a sanitizer.
inline int repetitions(int usual, int soak) {
  if (g_getenv("SOAK") != nullptr) return soak;
#ifdef SANITIZED
  return (usual + 3) / 4;
#else
  return usual;
#endif
}

/// An element between a source and a sink simulated by the test.
namespace harness {

inline testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != text.npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << '"' << text << "\" does not contain " << part;
}

struct Unref {
  void operator()(GstBuffer* buffer) const { gst_buffer_unref(buffer); }
  void operator()(GstEvent* event) const { gst_event_unref(event); }
  void operator()(GstCaps* caps) const { gst_caps_unref(caps); }
  void operator()(GstMessage* message) const { gst_message_unref(message); }
  void operator()(GstElement* element) const { gst_object_unref(element); }
  void operator()(GstPad* pad) const { gst_object_unref(pad); }
  void operator()(GstBus* bus) const { gst_object_unref(bus); }
  void operator()(GstHarness* h) const { gst_harness_teardown(h); }
};
template <class Type>
using Owned = std::unique_ptr<Type, Unref>;

using Buffer = Owned<GstBuffer>;

inline const char* const simulators[] = {
    "eventsim-frame",  "eventsim-dense",   "eventsim-sparse",  "eventsim-diff",
    "eventsim-dvs",    "gleventsim-frame", "gleventsim-dense", "gleventsim-sparse",
    "gleventsim-diff", "gleventsim-dvs"};

inline bool is_on_gpu(const std::string& element) {
  return element.starts_with("gl");
}

/// Instantiated once in each executable.
class EverySimulator : public testing::TestWithParam<const char*> {};

/// Simulators whose frames are in system memory, and in textures.
inline const auto on_cpu =
    static_cast<std::size_t>(std::ranges::find_if(simulators, is_on_gpu) - std::begin(simulators));
inline const auto cpu_simulators = std::span(simulators).first(on_cpu);
inline const auto gpu_simulators = std::span(simulators).subspan(on_cpu);

/// Caps of the pictures that a simulator draws. The tests read those in textures like others.
inline std::string pictures_of(const std::string& element) {
  return is_on_gpu(element) ? "video/x-raw(memory:GLMemory), format=RGBA"
                            : "video/x-raw, format=RGBA";
}

/// A simulator, taking frames in system memory.
inline std::string with_upload(const std::string& launch) {
  return (is_on_gpu(launch) ? "glupload ! " : "") + launch;
}

/// Text of an error or a warning; empty for none.
inline std::string text_of(GstMessage* message) {
  if (message == nullptr) return "";
  GError* error = nullptr;
  if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR)
    gst_message_parse_error(message, &error, nullptr);
  else
    gst_message_parse_warning(message, &error, nullptr);
  std::string text = error->message;
  g_error_free(error);
  return text;
}

inline std::string text_of(const Owned<GstCaps>& caps) {
  if (!caps) return "";
  gchar* const text = gst_caps_to_string(caps.get());
  std::string result = text;
  g_free(text);
  return result;
}

/// A counter of an element's `stats`.
inline guint64 stat_of(GstElement* element, const char* name) {
  GstStructure* stats = nullptr;
  g_object_get(element, "stats", &stats, nullptr);
  guint64 value = G_MAXUINT64;
  EXPECT_TRUE(gst_structure_get_uint64(stats, name, &value)) << name;
  gst_structure_free(stats);
  return value;
}

/// A plane of a video buffer.
struct Plane {
  gsize offset;
  int stride;  ///< bytes
};

inline void add_video_meta(GstBuffer* buffer, GstVideoFormat format, int width, int height,
                           const std::vector<Plane>& planes) {
  gsize offsets[GST_VIDEO_MAX_PLANES] = {};
  gint strides[GST_VIDEO_MAX_PLANES] = {};
  for (std::size_t i = 0; i < planes.size(); ++i) {
    offsets[i] = planes[i].offset;
    strides[i] = planes[i].stride;
  }
  gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, format,
                                 static_cast<guint>(width), static_cast<guint>(height),
                                 static_cast<guint>(planes.size()), offsets, strides);
}

class Harness {
 public:
  /// For example "eventsim-dense flow=dis-hq".
  explicit Harness(const std::string& launch)
      : Harness((gst_init(nullptr, nullptr), gst_harness_new_parse(with_upload(launch).c_str())),
                launch) {}

  /// For pads that are not the only ones of the element.
  Harness(const char* element, const char* sink, const char* src)
      : Harness((gst_init(nullptr, nullptr), gst_harness_new_with_padnames(element, sink, src)),
                element) {}

  /// For elements whose source pad appears with its first output.
  static GstHarness* with_late_pad(const std::string& launch) {
    gst_init(nullptr, nullptr);
    static GstStaticPadTemplate src =
        GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS_ANY);
    static GstStaticPadTemplate sink =
        GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS_ANY);
    GstElement* element = gst_parse_launch(launch.c_str(), nullptr);
    GstHarness* h = gst_harness_new_full(element, &src, "sink", &sink, nullptr);
    g_signal_connect(element, "pad-added",
                     G_CALLBACK(+[](GstElement*, GstPad* pad, GstHarness* to) {
                       gst_harness_add_element_src_pad(to, pad);
                     }),
                     h);
    gst_object_unref(element);
    return h;
  }

  Harness(GstHarness* h, const std::string& launch) {
    h_.reset(h);
    bus_.reset(gst_bus_new());
    gst_element_set_bus(h_->element, bus_.get());
    element_.reset(gst_harness_find_element(h_.get(), launch.substr(0, launch.find(' ')).c_str()));
  }
  ~Harness() {
    // The element keeps the test's bus until the end.
    gst_element_set_bus(h_->element, nullptr);
  }

  GstHarness* operator->() const { return h_.get(); }
  GstHarness* get() const { return h_.get(); }
  /// The simulator itself.
  GstElement* element() const { return element_.get(); }

  void caps(const std::string& in, const std::string& out = GST_EVENT_CAMERA_MEDIA_TYPE) {
    gst_harness_set_sink_caps_str(h_.get(), out.c_str());
    gst_harness_set_src_caps_str(h_.get(), in.c_str());
    GstCaps* caps = gst_caps_from_string(in.c_str());
    gst_video_info_from_caps(&info_, caps);
    gst_caps_unref(caps);
  }

  /// A frame with luma `grey(x, y)` in the negotiated format. Each row is followed by `padding`
  /// bytes, described by a GstVideoMeta.
  GstBuffer* frame(GstClockTime pts, const std::function<int(int x, int y)>& grey, int padding = 0,
                   int alpha = 255) const {
    gsize size = padding > 0 ? 0 : GST_VIDEO_INFO_SIZE(&info_);
    std::vector<Plane> planes;
    for (guint i = 0; padding > 0 && i < GST_VIDEO_INFO_N_PLANES(&info_); ++i) {
      planes.push_back({size, GST_VIDEO_INFO_PLANE_STRIDE(&info_, i) + padding});
      size += static_cast<gsize>(planes[i].stride * GST_VIDEO_INFO_HEIGHT(&info_));
    }
    GstBuffer* buffer = gst_buffer_new_allocate(nullptr, size, nullptr);
    gst_buffer_memset(buffer, 0, 0xa5, size);
    if (padding > 0)
      add_video_meta(buffer, GST_VIDEO_INFO_FORMAT(&info_), GST_VIDEO_INFO_WIDTH(&info_),
                     GST_VIDEO_INFO_HEIGHT(&info_), planes);
    const int components = GST_VIDEO_INFO_IS_RGB(&info_) ? 3 : 1;
    for (int component = 0; component < components; ++component) draw(buffer, component, grey);
    draw_alpha(buffer, alpha);
    GST_BUFFER_PTS(buffer) = pts;
    return buffer;
  }

  /// A frame in RGB, all of it of one colour.
  GstBuffer* colours(GstClockTime pts, const std::array<int, 3>& rgb) const {
    GstBuffer* const buffer = flat(pts, 0);
    for (int component = 0; component < 3; ++component)
      draw(buffer, component, [&](int, int) { return rgb[static_cast<std::size_t>(component)]; });
    return buffer;
  }

  GstBuffer* flat(GstClockTime pts, int grey) const {
    return frame(pts, [grey](int, int) { return grey; });
  }

  GstFlowReturn push(GstBuffer* buffer) { return gst_harness_push(h_.get(), buffer); }

  /// Waits until an aggregator has handled the events that were pushed, or a GPU the frames.
  void wait_for_events() {
    GstQuery* const query = gst_query_new_drain();
    gst_pad_peer_query(h_->srcpad, query);
    gst_query_unref(query);
  }

  /// The next output buffer, or null.
  Buffer pull() { return Buffer(gst_harness_try_pull(h_.get())); }

  /// The next output event of this type, or null; drops other events before it.
  Owned<GstEvent> pull_event(GstEventType type) {
    while (Owned<GstEvent> event{gst_harness_try_pull_event(h_.get())})
      if (GST_EVENT_TYPE(event.get()) == type) return event;
    return nullptr;
  }

  /// The next message of this type on the bus, or null; keeps other messages before it.
  Owned<GstMessage> message(GstMessageType type) {
    return Owned<GstMessage>(gst_bus_pop_filtered(bus_.get(), type));
  }
  /// Texts of the next warning and the next error, or empty.
  std::string warning() { return text_of(message(GST_MESSAGE_WARNING).get()); }
  std::string error() { return text_of(message(GST_MESSAGE_ERROR).get()); }
  std::string warning_or_error() {
    constexpr auto either = static_cast<GstMessageType>(GST_MESSAGE_WARNING | GST_MESSAGE_ERROR);
    return text_of(message(either).get());
  }

  std::string out_caps() const {
    return text_of(Owned<GstCaps>(gst_pad_get_current_caps(h_->sinkpad)));
  }

 private:
  void draw_alpha(GstBuffer* buffer, int alpha) const {
    if (GST_VIDEO_INFO_HAS_ALPHA(&info_))
      draw(buffer, GST_VIDEO_COMP_A, [alpha](int, int) { return alpha; });
  }

  /// Draws one component; others in the same words stay.
  void draw(GstBuffer* buffer, int component, const std::function<int(int x, int y)>& value) const {
    GstVideoFrame video;
    EXPECT_TRUE(gst_video_frame_map(&video, &info_, buffer, GST_MAP_READWRITE));
    const int step = GST_VIDEO_FRAME_COMP_PSTRIDE(&video, component);
    const guint depth = GST_VIDEO_INFO_COMP_DEPTH(&info_, component);
    const bool is_little_endian = depth == 8 || GST_VIDEO_FORMAT_INFO_IS_LE(info_.finfo);
    guint shift = GST_VIDEO_FORMAT_INFO_SHIFT(info_.finfo, component);
    const auto format = GST_VIDEO_INFO_FORMAT(&info_);
    if (format == GST_VIDEO_FORMAT_BGR16 || format == GST_VIDEO_FORMAT_BGR15)
      shift = component == 1   ? shift  // GStreamer gives the shifts of RGB16 and RGB15
              : component == 2 ? GST_VIDEO_FORMAT_INFO_SHIFT(info_.finfo, 0)
                               : 0;
    for (int y = 0; y < GST_VIDEO_INFO_HEIGHT(&info_); ++y) {
      auto* row = static_cast<guint8*>(GST_VIDEO_FRAME_COMP_DATA(&video, component)) +
                  y * GST_VIDEO_FRAME_COMP_STRIDE(&video, component);
      for (int x = 0; x < GST_VIDEO_INFO_WIDTH(&info_); ++x) {
        auto* sample = row + x * step;
        const guint white = (1U << depth) - 1;
        const guint bits = static_cast<guint>(value(x, y)) * white / 255 << shift;
        if (depth == 8) {
          *sample = static_cast<guint8>(bits);
        } else if (is_little_endian) {
          const guint others = depth < 8 ? GST_READ_UINT16_LE(sample) & ~(white << shift) : 0;
          GST_WRITE_UINT16_LE(sample, static_cast<guint16>(others | bits));
        } else {
          GST_WRITE_UINT16_BE(sample, static_cast<guint16>(bits));
        }
      }
    }
    gst_video_frame_unmap(&video);
  }

  Owned<GstHarness> h_;
  Owned<GstBus> bus_;
  Owned<GstElement> element_;
  GstVideoInfo info_{};
};

inline std::vector<GstEventCameraEvent> events_of(GstBuffer* buffer) {
  GstEventCameraMap map;
  EXPECT_TRUE(gst_event_camera_map(&map, buffer));
  std::vector<GstEventCameraEvent> events(map.events, map.events + map.n_events);
  gst_event_camera_unmap(&map);
  return events;
}

inline std::string bytes_of(GstBuffer* buffer) {
  std::string bytes(gst_buffer_get_size(buffer), '\0');
  gst_buffer_extract(buffer, 0, bytes.data(), bytes.size());
  return bytes;
}

/// Links a pad that appears on `element` to `sink`, at every start: a launch line does so only
/// once.
inline void link_late_pads(GstElement* element, GstElement* sink) {
  g_signal_connect_object(element, "pad-added",
                          G_CALLBACK(+[](GstElement* source, GstPad*, GstElement* to) {
                            gst_element_link(source, to);
                          }),
                          sink, static_cast<GConnectFlags>(0));
}

/// Flushes all inputs of an element, as a seek does: by events of one number.
inline void flush(std::initializer_list<GstHarness*> inputs) {
  const auto seqnum = gst_util_seqnum_next();
  const auto push = [&](GstEvent* event, GstHarness* h) {
    gst_event_set_seqnum(event, seqnum);
    gst_harness_push_event(h, event);
  };
  for (auto* h : inputs) push(gst_event_new_flush_start(), h);
  for (auto* h : inputs) push(gst_event_new_flush_stop(TRUE), h);
}

struct SegmentFields {
  GstClockTime start = 0;
  GstClockTime time = 0;  ///< of the stream, at the start
  GstClockTime stop = GST_CLOCK_TIME_NONE;
  GstClockTime base = 0;
  double rate = 1;
  GstFormat format = GST_FORMAT_TIME;
  GstSegmentFlags flags = GST_SEGMENT_FLAG_NONE;
};

inline GstEvent* segment_event(const SegmentFields& fields) {
  GstSegment segment;
  gst_segment_init(&segment, fields.format);
  segment.rate = fields.rate;
  segment.base = fields.base;
  segment.start = segment.position = fields.start;
  segment.time = fields.time;
  segment.stop = fields.stop;
  segment.flags = fields.flags;
  return gst_event_new_segment(&segment);
}

inline void push_segment(GstHarness* h, const SegmentFields& fields = {}) {
  gst_harness_push_event(h, segment_event(fields));
}

/// Ends the segment, but not the stream.
inline void end_segment(GstHarness* h, GstClockTime position = 0) {
  gst_harness_push_event(
      h, gst_event_new_segment_done(GST_FORMAT_TIME, static_cast<gint64>(position)));
}

/// Pushes caps that the element may refuse.
inline void push_caps(GstHarness* h, const char* text) {
  const Owned<GstCaps> caps(gst_caps_from_string(text));
  gst_harness_push_event(h, gst_event_new_caps(caps.get()));
}

inline void push_gap(GstHarness* h, GstClockTime start, GstClockTime duration = 10 * GST_MSECOND) {
  gst_harness_push_event(h, gst_event_new_gap(start, duration));
}

inline void push_eos(GstHarness* h) {
  gst_harness_push_event(h, gst_event_new_eos());
}

/// The buffers up to the end of the output.
inline std::vector<Buffer> pull_until_eos(GstHarness* h) {
  std::vector<Buffer> buffers;
  GstBuffer* next = nullptr;
  bool is_in_time = false;
  while ((is_in_time = gst_harness_pull_until_eos(h, &next) != FALSE) && next != nullptr)
    buffers.emplace_back(next);
  EXPECT_TRUE(is_in_time) << "no EOS";
  return buffers;
}

/// A buffer whose bytes are all of this value.
inline GstBuffer* filled(gsize size, int value, GstClockTime pts, GstClockTime duration) {
  GstBuffer* const buffer = gst_buffer_new_allocate(nullptr, size, nullptr);
  gst_buffer_memset(buffer, 0, static_cast<guint8>(value), size);
  GST_BUFFER_PTS(buffer) = pts;
  GST_BUFFER_DURATION(buffer) = duration;
  return buffer;
}

inline Owned<GstPad> static_pad(GstElement* element, const char* name) {
  return Owned<GstPad>(gst_element_get_static_pad(element, name));
}

/// Video formats in the template of a pad, in its last structure.
inline std::vector<std::string> video_formats(const char* factory, const char* pad) {
  gst_init(nullptr, nullptr);
  const Owned<GstElement> element(gst_element_factory_make(factory, nullptr));
  const Owned<GstCaps> caps(gst_pad_get_pad_template_caps(static_pad(element.get(), pad).get()));
  const GValue* const list = gst_structure_get_value(
      gst_caps_get_structure(caps.get(), gst_caps_get_size(caps.get()) - 1), "format");
  std::vector<std::string> names;
  for (guint i = 0; i < gst_value_list_get_size(list); ++i)
    names.emplace_back(g_value_get_string(gst_value_list_get_value(list, i)));
  return names;
}

/// Width and height in the caps of the output, as "320x240".
inline std::string size_of(GstHarness* h) {
  const Owned<GstCaps> caps(gst_pad_get_current_caps(h->sinkpad));
  if (!caps) return "none";
  int width = 0;
  int height = 0;
  gst_structure_get(gst_caps_get_structure(caps.get(), 0), "width", G_TYPE_INT, &width, "height",
                    G_TYPE_INT, &height, nullptr);
  return std::to_string(width) + "x" + std::to_string(height);
}

/// Drives an element with two sink pads, the first of which is passed to the source pad.
struct TwoInputs {
  TwoInputs(const std::string& launch, const char* first_pad, const char* second_pad) {
    gst_init(nullptr, nullptr);
    element.reset(GST_ELEMENT(gst_object_ref_sink(
        gst_parse_launch_full(launch.c_str(), nullptr, GST_PARSE_FLAG_NONE, nullptr))));
    bus.reset(gst_bus_new());
    gst_element_set_bus(element.get(), bus.get());
    first.reset(gst_harness_new_with_element(element.get(), first_pad, "src"));
    second.reset(gst_harness_new_with_element(element.get(), second_pad, nullptr));
    for (auto* h : both()) gst_harness_set_live(h, FALSE);
  }
  ~TwoInputs() { gst_element_set_bus(element.get(), nullptr); }

  std::array<GstHarness*, 2> both() const { return {first.get(), second.get()}; }
  void end() const {
    for (auto* h : both()) gst_harness_push_event(h, gst_event_new_eos());
  }
  /// Flushes both, as a seek does, and starts over.
  void start_over(const SegmentFields& fields = {}) const {
    flush({first.get(), second.get()});
    for (auto* h : both()) push_segment(h, fields);
  }

  Owned<GstMessage> message(GstMessageType type) {
    return Owned<GstMessage>(gst_bus_pop_filtered(bus.get(), type));
  }

  /// Text of the next warning, or empty.
  std::string warning() { return text_of(message(GST_MESSAGE_WARNING).get()); }

  /// Waits for an error message, as the source pad has its own thread.
  std::string error() {
    const Owned<GstMessage> next(
        gst_bus_timed_pop_filtered(bus.get(), 60 * GST_SECOND, GST_MESSAGE_ERROR));
    return text_of(next.get());
  }

  Owned<GstElement> element;
  Owned<GstBus> bus;
  Owned<GstHarness> first;
  Owned<GstHarness> second;
};

/// Name of the type of an event, or of a custom event.
inline std::string event_name(GstEvent* event) {
  const bool is_custom = GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_DOWNSTREAM;
  return is_custom ? gst_structure_get_name(gst_event_get_structure(event))
                   : GST_EVENT_TYPE_NAME(event);
}

/// Takes the buffers and downstream events that pass a pad.
struct Watcher {
  std::function<void(GstBuffer*)> take_buffer;
  std::function<void(GstEvent*)> take_event = [](GstEvent*) {};
};

inline void watch(GstPad* pad, Watcher watcher) {
  gst_pad_add_probe(
      pad,
      static_cast<GstPadProbeType>(GST_PAD_PROBE_TYPE_DATA_DOWNSTREAM |
                                   GST_PAD_PROBE_TYPE_EVENT_FLUSH),
      +[](GstPad*, GstPadProbeInfo* info, gpointer data) {
        const auto& [take_buffer, take_event] = *static_cast<Watcher*>(data);
        if ((GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER) != 0)
          take_buffer(GST_PAD_PROBE_INFO_BUFFER(info));
        else if ((GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER_LIST) != 0)
          take_buffer(gst_buffer_list_get(GST_PAD_PROBE_INFO_BUFFER_LIST(info), 0));
        else
          take_event(GST_PAD_PROBE_INFO_EVENT(info));
        return GST_PAD_PROBE_OK;
      },
      new Watcher(std::move(watcher)), +[](gpointer data) { delete static_cast<Watcher*>(data); });
}

/// The buffers and events of an output, in order: "buffer", or the name of the event.
class OutputOrder {
 public:
  explicit OutputOrder(GstHarness* h) {
    watch(h->sinkpad, {[this](GstBuffer*) { names_.emplace_back("buffer"); },
                       [this](GstEvent* event) { names_.push_back(event_name(event)); }});
  }

  /// Once the output has ended.
  const std::vector<std::string>& names() const { return names_; }

 private:
  std::vector<std::string> names_;
};

/// Pushes an empty custom event, which is serialized with the data.
inline void push_custom(GstHarness* h, const char* name = "any") {
  gst_harness_push_event(
      h, gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, gst_structure_new_empty(name)));
}

/// Waits for the next output event of this type; drops other events before it.
inline Owned<GstEvent> next_event(GstHarness* h, GstEventType type) {
  while (Owned<GstEvent> event{gst_harness_pull_event(h)})
    if (GST_EVENT_TYPE(event.get()) == type) return event;
  return nullptr;
}

/// A simulator, on the GPU, too, that takes frames in system memory.
inline Harness without_upload(const std::string& launch) {
  gst_init(nullptr, nullptr);
  return {gst_harness_new_parse(launch.c_str()), launch};
}

struct Gap {
  GstClockTime start = 0;
  GstClockTime duration = 0;

  friend bool operator==(const Gap&, const Gap&) = default;
  friend void PrintTo(const Gap& gap, std::ostream* out) {
    *out << gap.start << " ns + " << gap.duration << " ns";
  }
};

inline Gap gap_of(GstEvent* event) {
  Gap gap;
  gst_event_parse_gap(event, &gap.start, &gap.duration);
  return gap;
}

}  // namespace harness
