// SPDX-License-Identifier: LGPL-2.1-or-later
// Properties of the simulators: descriptions, presets, profiles, and values that change over time.
#include <gst/controller/gstdirectcontrolbinding.h>
#include <gst/controller/gstinterpolationcontrolsource.h>

#include <algorithm>
#include <array>
#include <map>
#include <string>

#include "tests/elements/pipeline.hpp"

namespace {

using namespace harness;

double number(GstElement* element, const char* property) {
  GValue value = G_VALUE_INIT;
  g_value_init(&value, G_TYPE_DOUBLE);
  g_object_get_property(G_OBJECT(element), property, &value);
  return g_value_get_double(&value);
}

TEST(Choices, AreNamedIfAValueIsNoneOfThem) {
  gst_init(nullptr, nullptr);
  Owned<GstElement> element(gst_element_factory_make("eventsim-dvs", nullptr));
  const auto set = [&](const char* value) {
    gst_util_set_object_arg(G_OBJECT(element.get()), "preset", value);
    gint preset = -1;
    g_object_get(element.get(), "preset", &preset, nullptr);
    return preset;
  };
  const gint esim = set("esim");
  g_test_expect_message(nullptr, G_LOG_LEVEL_MESSAGE,
                        "preset=davis999: choose one of standard, ideal, *, gen4, hs-ergb");
  EXPECT_EQ(set("davis999"), esim);
  g_test_assert_expected_messages();
  EXPECT_EQ(set("0"), 0);
  EXPECT_EQ(set(std::to_string(esim).c_str()), esim);
}

TEST(Dvs, TakesWhatIsNotSetFromItsPreset) {
  gst_init(nullptr, nullptr);
  const Owned<GstElement> element(
      gst_parse_launch("eventsim-dvs threshold-sigma=0.07 refractory-reset=signal "
                       "seed=18446744073709551615 preset=v2e-noisy",
                       nullptr));
  EXPECT_EQ(number(element.get(), "threshold-sigma"), 0.07);
  EXPECT_EQ(number(element.get(), "shot-noise-rate"), 5);
  gst_util_set_object_arg(G_OBJECT(element.get()), "preset", "icns");
  EXPECT_EQ(number(element.get(), "threshold-sigma"), 0.07);
  EXPECT_EQ(number(element.get(), "positive-threshold"), 0.4);
  EXPECT_EQ(number(element.get(), "refractory-period"), 100'000);
  gint reset = 0;
  guint64 seed = 0;
  g_object_get(element.get(), "refractory-reset", &reset, "seed", &seed, nullptr);
  EXPECT_EQ(reset, 1);
  EXPECT_EQ(seed, G_MAXUINT64);
}

TEST(Dvs, TakesFromAProfileWhatIsNotSet) {
  gst_init(nullptr, nullptr);
  const TemporaryFile profile(std::string(
      "# of a camera\n[eventsim-dvs]\nresponse=log\nlog-eps=0.02\nthreshold-sigma=0.04\n"
      "leak-rate=3\nrefractory-period=5000\n"));
  std::array<int, 3> order = {0, 1, 2};
  do {
    Owned<GstElement> owned(gst_element_factory_make("eventsim-dvs", nullptr));
    GstElement* element = owned.get();
    for (const int step : order) {
      if (step == 0) gst_util_set_object_arg(G_OBJECT(element), "preset", "v2e-noisy");
      if (step == 1) g_object_set(element, "profile", profile.path().c_str(), nullptr);
      if (step == 2) g_object_set(element, "threshold-sigma", 0.07, nullptr);
    }
    EXPECT_EQ(number(element, "threshold-sigma"), 0.07);
    EXPECT_EQ(number(element, "log-eps"), 0.02);
    EXPECT_EQ(number(element, "leak-rate"), 3);
    EXPECT_EQ(number(element, "refractory-period"), 5000);
    EXPECT_EQ(number(element, "shot-noise-rate"), 5);
    g_object_set(element, "profile", nullptr, nullptr);
    EXPECT_EQ(number(element, "leak-rate"), 0.1);
  } while (std::ranges::next_permutation(order).found);
}

TEST(Dvs, DoesNotStartWithAProfileThatItCannotRead) {
  const auto error_of = [](const std::string& path) {
    Pipeline pipeline("eventsim-dvs profile=" + in_quotes(path) + " ! fakesink");
    EXPECT_FALSE(pipeline.play());
    return pipeline.error;
  };
  EXPECT_TRUE(contains(error_of("/nowhere/a.profile"), "\"/nowhere/a.profile\": No such file"));
  EXPECT_TRUE(contains(error_of("/"), "event-calibrate --profile"));
  struct Case {
    std::string text;
    std::string words;
  };
  for (const auto& [text, words] : {
           Case{"", "no group [eventsim-dvs]"},
           Case{"log-eps=0.02\n", "Cannot read the camera profile"},
           Case{"[eventsim-dvs]\ngain=2\n", "sets gain, which eventsim-dvs does not have"},
           Case{"[eventsim-dvs]\nlog-eps=7\n", "sets log-eps to a value that it cannot have"},
           Case{"[eventsim-dvs]\nresponse=cube\n", "sets response to a value"},
           Case{"[eventsim-dvs]\n" + std::string(70'000, '#'), "64 KiB"},
       })
    EXPECT_TRUE(contains(error_of(TemporaryFile(text).path()), words));
}

TEST(Dvs, HasPresetsInRange) {
  gst_init(nullptr, nullptr);
  const Owned<GstElement> element(gst_element_factory_make("eventsim-dvs", nullptr));
  GObject* const object = G_OBJECT(element.get());
  const auto* const presets =
      G_PARAM_SPEC_ENUM(g_object_class_find_property(G_OBJECT_GET_CLASS(object), "preset"))
          ->enum_class;
  guint count = 0;
  GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(object), &count);
  for (guint preset = 0; preset < presets->n_values; ++preset) {
    g_object_set(object, "preset", presets->values[preset].value, nullptr);
    for (guint i = 0; i < count; ++i) {
      if (!G_IS_PARAM_SPEC_DOUBLE(specs[i])) continue;
      const double here = number(element.get(), specs[i]->name);
      EXPECT_GE(here, G_PARAM_SPEC_DOUBLE(specs[i])->minimum) << preset << " " << specs[i]->name;
      EXPECT_LE(here, G_PARAM_SPEC_DOUBLE(specs[i])->maximum) << preset << " " << specs[i]->name;
    }
  }
  g_free(specs);
}

/// The properties of an element and their default values, as text.
std::map<std::string, std::string> defaults_of(const char* name) {
  const Owned<GstElement> element(gst_element_factory_make(name, nullptr));
  guint count = 0;
  GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element.get()), &count);
  std::map<std::string, std::string> defaults;
  for (guint i = 0; i < count; ++i) {
    const GValue* value = g_param_spec_get_default_value(specs[i]);
    const bool is_null = G_VALUE_HOLDS_STRING(value) || G_VALUE_HOLDS_BOXED(value);
    gchar* text = is_null ? g_strdup("") : g_strdup_value_contents(value);
    defaults[specs[i]->name] = text;
    g_free(text);
  }
  g_free(specs);
  return defaults;
}

TEST(Dvs, HasTheSamePropertiesOnTheGpuExceptLabels) {
  gst_init(nullptr, nullptr);
  auto on_cpu_defaults = defaults_of("eventsim-dvs");
  EXPECT_EQ(on_cpu_defaults.erase("label"), 1U);
  EXPECT_EQ(defaults_of("gleventsim-dvs"), on_cpu_defaults);
}

TEST(Dvs, CountsTimeInNanoseconds) {
  Harness h("eventsim-dvs preset=ideal pixel-latency=7000000");
  h.caps("video/x-raw, format=GRAY8, width=8, height=8, framerate=25/1");
  h.push(h.flat(0, 20));
  h.push(h.flat(40 * GST_MSECOND, 200));
  const auto buffer = h.pull();
  ASSERT_TRUE(buffer);
  const auto first = events_of(buffer.get()).front().t;
  EXPECT_GE(first, 7000U);
  EXPECT_LT(first, 12'000U);
}

/// Sets `property` to the values at these times of the stream.
void control(GstElement* element, const char* property,
             std::initializer_list<std::pair<GstClockTime, double>> values) {
  GstControlSource* source = gst_interpolation_control_source_new();
  g_object_set(source, "mode", GST_INTERPOLATION_MODE_LINEAR, nullptr);
  for (const auto& [time, value] : values)
    gst_timed_value_control_source_set(GST_TIMED_VALUE_CONTROL_SOURCE(source), time, value);
  EXPECT_TRUE(gst_object_add_control_binding(
      GST_OBJECT(element),
      gst_direct_control_binding_new_absolute(GST_OBJECT(element), property, source)));
  gst_object_unref(source);
}

TEST_P(EverySimulator, HasThresholdsThatChangeOverTime) {
  const double unit = std::string(GetParam()).ends_with("eventsim-dvs") ? 0.1 : 1;
  Harness h(GetParam());
  for (const char* property : {"positive-threshold", "negative-threshold"})
    control(h.element(), property, {{0, 20 * unit}, {5 * GST_SECOND, 100 * unit}});
  h.caps("video/x-raw, format=GRAY8, width=32, height=24, framerate=25/1");
  push_segment(h.get(), {.start = GST_SECOND, .time = 0});
  for (int i = 0; i < 3; ++i) {
    h.push(h.flat(GST_SECOND + static_cast<GstClockTime>(i) * 2500 * GST_MSECOND, 90));
    EXPECT_NEAR(number(h.element(), "positive-threshold"), (20 + 40 * i) * unit, 1e-9);
    EXPECT_NEAR(number(h.element(), "negative-threshold"), (20 + 40 * i) * unit, 1e-9);
  }
}

TEST(Dvs, ChangesOverTimeButItsSensorStaysTheSame) {
  Harness h("eventsim-dvs");
  control(h.element(), "positive-threshold",
          {{0, 0.2}, {40 * GST_MSECOND, 0.2}, {80 * GST_MSECOND, 10}});
  control(h.element(), "refractory-period", {{0, 0}, {200 * GST_MSECOND, 2'000'000}});
  h.caps("video/x-raw, format=GRAY8, width=32, height=24, framerate=25/1");
  std::vector<bool> fired;
  for (int i = 0; i < 6; ++i) {
    h.push(h.flat(static_cast<GstClockTime>(i) * 40 * GST_MSECOND, 20 + 40 * i));
    if (i > 0) fired.push_back(h.pull() != nullptr);
  }
  EXPECT_EQ(number(h.element(), "refractory-period"), 2'000'000);
  EXPECT_EQ(fired, std::vector<bool>({true, false, false, false, false}));
  for (const auto& [property, is_controllable] :
       {std::pair("seed", false), {"threshold-sigma", false}, {"leak-rate", true}})
    EXPECT_EQ((g_object_class_find_property(G_OBJECT_GET_CLASS(h.element()), property)->flags &
               GST_PARAM_CONTROLLABLE) != 0,
              is_controllable)
        << property;
}

}  // namespace
