// SPDX-License-Identifier: LGPL-2.1-or-later
// Defaults are those of the paper's table of settings, and the metadata shown by gst-inspect-1.0 is
// complete.
#include "tests/elements/harness.hpp"

namespace {

using namespace harness;

double number(GstElement* element, const char* property) {
  GValue value = G_VALUE_INIT;
  g_value_init(&value, G_TYPE_DOUBLE);
  g_object_get_property(G_OBJECT(element), property, &value);
  return g_value_get_double(&value);
}

bool has(GstElement* element, const char* property) {
  return g_object_class_find_property(G_OBJECT_GET_CLASS(element), property) != nullptr;
}

struct Defaults {
  const char* element;
  double threshold;
  bool interpolates;
  double unit = 1;  ///< unit of the thresholds set by a test
};

class EveryElement : public testing::TestWithParam<Defaults> {};
INSTANTIATE_TEST_SUITE_P(, EveryElement,
                         testing::Values(Defaults{"eventsim-frame", 20, false},
                                         Defaults{"eventsim-dense", 2, true},
                                         Defaults{"eventsim-sparse", 10, true},
                                         Defaults{"eventsim-diff", 20, true},
                                         Defaults{"eventsim-dvs", 0.2, false, 0.1}));

TEST_P(EveryElement, HasTheDefaultsOfTheTable) {
  gst_init(nullptr, nullptr);
  Owned<GstElement> element(gst_element_factory_make(GetParam().element, nullptr));
  ASSERT_TRUE(element);
  EXPECT_EQ(number(element.get(), "positive-threshold"), GetParam().threshold);
  EXPECT_EQ(number(element.get(), "negative-threshold"), GetParam().threshold);
  EXPECT_EQ(number(element.get(), "n-threads"), 0);
  EXPECT_EQ(has(element.get(), "interpolated-frames"), GetParam().interpolates);
  if (GetParam().interpolates) {
    EXPECT_EQ(number(element.get(), "interpolated-frames"), 10);
  }
}

TEST_P(EveryElement, KeepsWhatIsSet) {
  gst_init(nullptr, nullptr);
  Owned<GstElement> element(gst_element_factory_make(GetParam().element, nullptr));
  const double positive = 12.5 * GetParam().unit;
  const double negative = 7 * GetParam().unit;
  g_object_set(element.get(), "positive-threshold", positive, "negative-threshold", negative,
               nullptr);
  gst_util_set_object_arg(G_OBJECT(element.get()), "palette", "red-blue");
  EXPECT_EQ(number(element.get(), "positive-threshold"), positive);
  EXPECT_EQ(number(element.get(), "negative-threshold"), negative);
  gint palette = 0;
  g_object_get(element.get(), "palette", &palette, nullptr);
  EXPECT_EQ(palette, GST_EVENT_CAMERA_PALETTE_RED_BLUE);
}

TEST_P(EveryElement, DescribesItself) {
  gst_init(nullptr, nullptr);
  Owned<GstElement> element(gst_element_factory_make(GetParam().element, nullptr));
  GstElementFactory* factory = gst_element_get_factory(element.get());
  EXPECT_STREQ(gst_element_factory_get_metadata(factory, GST_ELEMENT_METADATA_KLASS),
               "Filter/Effect/Converter/Video");
  EXPECT_EQ(gst_plugin_feature_get_rank(GST_PLUGIN_FEATURE(factory)), GST_RANK_NONE);
  guint count = 0;
  GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element.get()), &count);
  for (guint i = 0; i < count; ++i) {
    if (g_type_is_a(specs[i]->owner_type, GST_TYPE_ELEMENT)) {
      EXPECT_NE(g_param_spec_get_blurb(specs[i]), nullptr) << specs[i]->name;
    }
    const bool ours = std::string(g_type_name(specs[i]->owner_type)).rfind("GstEventSim", 0) == 0;
    EXPECT_TRUE(!ours || (specs[i]->flags & GST_PARAM_MUTABLE_PLAYING)) << specs[i]->name;
  }
  g_free(specs);
}

TEST(Dense, NamesItsFlowsAndInterpolations) {
  gst_init(nullptr, nullptr);
  Owned<GstElement> element(gst_element_factory_make("eventsim-dense", nullptr));
  for (const char* flow : {"dis-lq", "dis-hq", "farneback"}) {
    gst_util_set_object_arg(G_OBJECT(element.get()), "flow", flow);
    gchar* back = nullptr;
    GValue value = G_VALUE_INIT;
    g_value_init(
        &value,
        g_object_class_find_property(G_OBJECT_GET_CLASS(element.get()), "flow")->value_type);
    g_object_get_property(G_OBJECT(element.get()), "flow", &value);
    back = gst_value_serialize(&value);
    EXPECT_STREQ(back, flow);
    g_free(back);
    g_value_unset(&value);
  }
  gst_util_set_object_arg(G_OBJECT(element.get()), "interpolation", "blend");
  gint interpolation = 0;
  g_object_get(element.get(), "interpolation", &interpolation, nullptr);
  EXPECT_EQ(interpolation, 1);
}

TEST(Dvs, TakesWhatIsNotSetFromItsPreset) {
  gst_init(nullptr, nullptr);
  for (const bool preset_is_first : {true, false}) {
    Owned<GstElement> owned(gst_element_factory_make("eventsim-dvs", nullptr));
    GstElement* element = owned.get();
    const auto set = [&](const char* property, const char* value) {
      gst_util_set_object_arg(G_OBJECT(element), property, value);
    };
    if (preset_is_first) set("preset", "v2e-noisy");
    set("threshold-sigma", "0.07");
    set("refractory-reset", "signal");
    set("seed", "18446744073709551615");
    if (!preset_is_first) set("preset", "v2e-noisy");
    EXPECT_EQ(number(element, "threshold-sigma"), 0.07);
    EXPECT_EQ(number(element, "cutoff-hz"), 30);
    EXPECT_EQ(number(element, "shot-noise-rate-hz"), 5);
    EXPECT_EQ(number(element, "leak-rate-hz"), 0.1);
    set("preset", "icns");
    EXPECT_EQ(number(element, "threshold-sigma"), 0.07);
    EXPECT_EQ(number(element, "positive-threshold"), 0.4);
    EXPECT_EQ(number(element, "refractory-period"), 100);
    EXPECT_EQ(number(element, "latency"), 100);
    gint reset = 0;
    guint64 seed = 0;
    g_object_get(element, "refractory-reset", &reset, "seed", &seed, nullptr);
    EXPECT_EQ(reset, 1);
    EXPECT_EQ(seed, G_MAXUINT64);
  }
}

TEST(Dvs, NamesItsPresetsAndTheirsAreInRange) {
  gst_init(nullptr, nullptr);
  Owned<GstElement> element(gst_element_factory_make("eventsim-dvs", nullptr));
  GObject* object = G_OBJECT(element.get());
  for (const char* preset :
       {"ideal", "esim", "v2e-clean", "v2e-noisy", "icns", "davis346", "gen4"}) {
    gst_util_set_object_arg(object, "preset", preset);
    GValue value = G_VALUE_INIT;
    g_value_init(&value,
                 g_object_class_find_property(G_OBJECT_GET_CLASS(object), "preset")->value_type);
    g_object_get_property(object, "preset", &value);
    gchar* back = gst_value_serialize(&value);
    EXPECT_STREQ(back, preset);
    g_free(back);
    g_value_unset(&value);
    guint count = 0;
    GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(object), &count);
    for (guint i = 0; i < count; ++i) {
      if (!G_IS_PARAM_SPEC_DOUBLE(specs[i])) continue;
      const double here = number(element.get(), specs[i]->name);
      EXPECT_GE(here, G_PARAM_SPEC_DOUBLE(specs[i])->minimum) << preset << " " << specs[i]->name;
      EXPECT_LE(here, G_PARAM_SPEC_DOUBLE(specs[i])->maximum) << preset << " " << specs[i]->name;
    }
    g_free(specs);
  }
}

}  // namespace
