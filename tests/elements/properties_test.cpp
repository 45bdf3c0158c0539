// SPDX-License-Identifier: LGPL-2.1-or-later
// Defaults are those of the paper's table of settings, and what gst-inspect-1.0 tells is complete.
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
};

class EveryElement : public testing::TestWithParam<Defaults> {};
INSTANTIATE_TEST_SUITE_P(, EveryElement,
                         testing::Values(Defaults{"eventsim-frame", 20, false},
                                         Defaults{"eventsim-dense", 2, true},
                                         Defaults{"eventsim-sparse", 10, true},
                                         Defaults{"eventsim-diff", 20, true}));

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
  gst_util_set_object_arg(G_OBJECT(element.get()), "positive-threshold", "12.5");
  gst_util_set_object_arg(G_OBJECT(element.get()), "negative-threshold", "7");
  gst_util_set_object_arg(G_OBJECT(element.get()), "palette", "red-blue");
  EXPECT_EQ(number(element.get(), "positive-threshold"), 12.5);
  EXPECT_EQ(number(element.get(), "negative-threshold"), 7);
  gint palette = 0;
  g_object_get(element.get(), "palette", &palette, nullptr);
  EXPECT_EQ(palette, GST_EVENT_CAMERA_PALETTE_RED_BLUE);
}

TEST_P(EveryElement, DescribesItself) {
  gst_init(nullptr, nullptr);
  Owned<GstElement> element(gst_element_factory_make(GetParam().element, nullptr));
  GstElementFactory* factory = gst_element_get_factory(element.get());
  EXPECT_STREQ(gst_element_factory_get_metadata(factory, GST_ELEMENT_METADATA_KLASS),
               "Converter/Video");
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

}  // namespace
