// SPDX-License-Identifier: LGPL-2.1-or-later
// Sets the properties of every element to random values while it plays, seeks and stops, and reads
// them in another thread. ThreadSanitizer reports what is shared without a lock.
#include <atomic>
#include <cmath>
#include <fstream>
#include <string>
#include <thread>

#include "tests/elements/element_lines.hpp"

namespace {

using namespace element_lines;
using Random = std::mt19937_64;

/// Value of a property.
class Value {
 public:
  explicit Value(const GParamSpec* spec) { g_value_init(&value_, spec->value_type); }
  ~Value() { g_value_unset(&value_); }
  Value(const Value&) = delete;
  Value& operator=(const Value&) = delete;

  GValue* get() { return &value_; }
  std::string text() const {
    gchar* const text = g_strdup_value_contents(&value_);
    std::string result = text;
    g_free(text);
    return result;
  }

 private:
  GValue value_ = G_VALUE_INIT;
};

/// Path of a camera profile.
std::string profile() {
  auto path = recording_files::Folder::path("camera.profile");
  std::ofstream(path) << "[eventsim-dvs]\nlog-eps=0.05\nleak-rate=3\n";
  return path;
}

/// Path of a list of hot pixels, which eventhotpixel reads and may write.
std::string hot_pixels() {
  auto path = recording_files::Folder::path("hot.pixels");
  std::ofstream(path) << "# Hot pixels: column and row\n3 4\n";
  return path;
}

/// Numbers are of every magnitude, and often an end of the range.
void randomize(GParamSpec* spec, Random& random, GValue* value) {
  const double number =
      std::ldexp(static_cast<double>(random() >> 1U), -static_cast<int>(random() % 100));
  switch (G_TYPE_FUNDAMENTAL(spec->value_type)) {
    case G_TYPE_BOOLEAN:
      g_value_set_boolean(value, random() % 2 == 0);
      break;
    case G_TYPE_ENUM: {
      const auto* const type = G_PARAM_SPEC_ENUM(spec)->enum_class;
      g_value_set_enum(value, type->values[random() % type->n_values].value);
      break;
    }
    case G_TYPE_UINT:
      g_value_set_uint(value, static_cast<guint>(static_cast<guint64>(number)));
      break;
    case G_TYPE_INT64:
      g_value_set_int64(value, static_cast<gint64>(number / 2) * (random() % 2 == 0 ? 1 : -1));
      break;
    case G_TYPE_UINT64:
      g_value_set_uint64(value, static_cast<guint64>(number));
      break;
    case G_TYPE_DOUBLE:
      g_value_set_double(value, number);
      break;
    case G_TYPE_STRING:
      if (spec->name == std::string_view("column-order"))
        g_value_set_static_string(value, random() % 2 == 0 ? "" : "txyp");
      else if (spec->name == std::string_view("events-path"))
        g_value_set_static_string(value, random() % 2 == 0 ? "" : "events");
      else if (spec->name == std::string_view("topics"))
        g_value_set_static_string(value,
                                  random() % 2 == 0 ? "" : "/event_camera/events,/camera/events");
      else if (spec->name == std::string_view("profile"))
        g_value_take_string(value, g_strdup(random() % 2 == 0 ? "" : profile().c_str()));
      else if (spec->owner_type == g_type_from_name("GstEventHotPixel"))
        g_value_take_string(value, g_strdup(hot_pixels().c_str()));
      else  // files to write
        g_value_take_string(value, g_strdup(recording_files::Folder::path("set").c_str()));
      break;
    default:
      FAIL() << "no random value for the type of " << spec->name;
  }
  g_param_value_validate(spec, value);  // clamps it
}

std::vector<GParamSpec*> properties_of(GstElement* element) {
  guint count = 0;
  GParamSpec** const specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element), &count);
  std::vector<GParamSpec*> properties(specs, specs + count);
  g_free(specs);
  return properties;
}

/// Lengths of windows, which at random may be hours: a pipeline would wait for the first one.
bool is_window_length(const GParamSpec* spec) {
  constexpr std::string_view lengths[] = {"accumulation-time", "event-count", "frame-count"};
  return g_type_name(spec->owner_type) == std::string_view("GstEventTensor") &&
         std::ranges::find(lengths, spec->name) != std::end(lengths);
}

/// Without those of GStreamer's base classes, and those that a payloader must share.
std::vector<GParamSpec*> writable_properties_of(GstElement* element) {
  auto properties = properties_of(element);
  std::erase_if(properties, [](const GParamSpec* spec) {
    constexpr std::string_view excluded[] = {
        "GstObject",         "GstBaseTransform",    "GstAggregator",         "GstBaseSink",
        "GstRTPBasePayload", "GstRTPBaseDepayload", "GstEventDatagramDepay", "GstEventMask",
        "GstEventUndistort",  // read files
        "GstEvtParse",        // has to match its input
        "GstEventCrop"};      // may leave nothing
    return (spec->flags & G_PARAM_WRITABLE) == 0 || is_window_length(spec) ||
           spec->name == std::string_view("min-streams") ||  // waits for streams that never come
           std::ranges::find(excluded, g_type_name(spec->owner_type)) != std::end(excluded);
  });
  return properties;
}

/// Reads all properties of an element repeatedly in its own thread.
class PropertyReader {
 public:
  explicit PropertyReader(GstElement* element)
      : element_(element), thread_([this] { read_until_done(); }) {}
  ~PropertyReader() {
    done_ = true;
    thread_.join();
  }
  PropertyReader(const PropertyReader&) = delete;
  PropertyReader& operator=(const PropertyReader&) = delete;

 private:
  void read_until_done() {
    const auto properties = properties_of(element_);
    while (!done_) {
      for (GParamSpec* spec : properties) {
        if ((spec->flags & G_PARAM_READABLE) == 0) continue;
        Value value(spec);
        g_object_get_property(G_OBJECT(element_), spec->name, value.get());
        EXPECT_FALSE(g_param_value_validate(spec, value.get()))
            << spec->name << " was out of range; it is clamped to " << value.text();
      }
      g_usleep(100);
    }
  }

  GstElement* element_;
  std::atomic<bool> done_ = false;
  std::thread thread_;
};

/// Pipeline with the element.
class Playback {
 public:
  explicit Playback(const Kind& kind)
      : pipeline_(launched(kind.launch_with_sources(1'000'000))),
        element_(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "it")) {}
  ~Playback() { gst_element_set_state(pipeline_.get(), GST_STATE_NULL); }
  Playback(const Playback&) = delete;
  Playback& operator=(const Playback&) = delete;

  GstElement* element() const { return element_.get(); }

  void reach(GstState state) {
    gst_element_set_state(pipeline_.get(), state);
    ASSERT_EQ(gst_element_get_state(pipeline_.get(), nullptr, nullptr, 60 * GST_SECOND),
              GST_STATE_CHANGE_SUCCESS)
        << gst_element_state_get_name(state) << " not reached";
    check_messages();
  }

  /// Only readers can.
  void seek(GstClockTime to) {
    gst_element_seek_simple(pipeline_.get(), GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
                            static_cast<gint64>(to));
    check_messages();
  }

  void set(GParamSpec* spec, GValue* value) {
    g_object_set_property(G_OBJECT(element()), spec->name, value);
    Value read(spec);
    g_object_get_property(G_OBJECT(element()), spec->name, read.get());
    EXPECT_EQ(g_param_values_cmp(spec, value, read.get()), 0)
        << spec->name << " is " << read.text() << " after it was set";
  }

 private:
  void check_messages() {
    const Owned<GstBus> bus(gst_element_get_bus(pipeline_.get()));
    while (const Owned<GstMessage> message{gst_bus_pop_filtered(bus.get(), GST_MESSAGE_ERROR)}) {
      gchar* cause = nullptr;
      gst_message_parse_error(message.get(), nullptr, &cause);
      ADD_FAILURE() << harness::text_of(message.get()) << " " << cause;
      g_free(cause);
    }
  }

  Owned<GstElement> pipeline_;
  Owned<GstElement> element_;
};

class EveryElement : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, EveryElement, testing::ValuesIn(element_names()),
                         element_lines::test_name);

TEST_P(EveryElement, TakesRandomPropertiesWhilePlaying) {
  Playback playback{Kind(GetParam())};
  const PropertyReader reader(playback.element());
  const auto properties = writable_properties_of(playback.element());
  Random random(1);  // NOLINT(bugprone-random-generator-seed): reproducible
  playback.reach(GST_STATE_PLAYING);
  for (int i = repetitions(200, 2'000); i > 0 && !HasFailure(); --i) {
    if (!properties.empty()) {
      GParamSpec* const spec = properties[random() % properties.size()];
      Value value(spec);
      randomize(spec, random, value.get());
      playback.set(spec, value.get());
    }
    g_usleep(500);
    if (i % 20 == 0) playback.seek(random() % 5 * GST_SECOND);
    if (i % 50 == 0) {
      playback.reach(i % 100 == 0 ? GST_STATE_NULL : GST_STATE_READY);
      playback.reach(GST_STATE_PLAYING);
    }
  }
}

}  // namespace
