// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/measures/report.hpp"

#include <json-glib/json-glib.h>

#include "gst/base/named_file.hpp"

using namespace eventcamera;

namespace {

struct Unref {
  void operator()(JsonNode* node) const { json_node_unref(node); }
  void operator()(JsonGenerator* generator) const { g_object_unref(generator); }
  void operator()(gchar* text) const { g_free(text); }
};
template <class Type>
using Owned = std::unique_ptr<Type, Unref>;

constexpr std::array interval_names = {"interval-p5", "interval-p25", "interval-p50",
                                       "interval-p75", "interval-p95"};
static_assert(interval_names.size() == interval_shares.size());

JsonNode* node_of(const GstStructure* structure);

/// Converts numbers, booleans, structures and arrays, the only types in these structures.
JsonNode* node_of(const GValue* value) {
  if (GST_VALUE_HOLDS_STRUCTURE(value)) return node_of(gst_value_get_structure(value));
  if (GST_VALUE_HOLDS_ARRAY(value)) {
    JsonArray* array = json_array_new();
    for (guint i = 0; i < gst_value_array_get_size(value); ++i)
      json_array_add_element(array, node_of(gst_value_array_get_value(value, i)));
    JsonNode* node = json_node_new(JSON_NODE_ARRAY);
    json_node_take_array(node, array);
    return node;
  }
  GValue number = G_VALUE_INIT;
  g_value_init(&number, G_VALUE_HOLDS_UINT64(value) ? G_TYPE_INT64 : G_VALUE_TYPE(value));
  g_value_transform(value, &number);
  JsonNode* node = json_node_new(JSON_NODE_VALUE);
  json_node_set_value(node, &number);
  g_value_unset(&number);
  return node;
}

JsonNode* node_of(const GstStructure* structure) {
  JsonObject* object = json_object_new();
  for (gint i = 0; i < gst_structure_n_fields(structure); ++i) {
    const gchar* name = gst_structure_nth_field_name(structure, static_cast<guint>(i));
    json_object_set_member(object, name, node_of(gst_structure_get_value(structure, name)));
  }
  JsonNode* node = json_node_new(JSON_NODE_OBJECT);
  json_node_take_object(node, object);
  return node;
}

/// Returns why a file cannot be written; none if it can, or if `path` is empty.
std::optional<std::string> obstacle_to(const std::string& path) {
  if (path.empty()) return std::nullopt;
  const Owned<gchar> folder(g_path_get_dirname(path.c_str()));
  if (!g_file_test(folder.get(), G_FILE_TEST_IS_DIR))
    return "No such folder: \"" + std::string(folder.get()) + "\".";
  if (g_file_test(path.c_str(), G_FILE_TEST_IS_DIR)) return "\"" + path + "\" is a folder.";
  return std::nullopt;
}

/// Throws std::runtime_error with the reason.
void write_json(const GstStructure* structure, const std::string& path) {
  const Owned<JsonNode> root(node_of(structure));
  const Owned<JsonGenerator> generator(json_generator_new());
  json_generator_set_pretty(generator.get(), TRUE);
  json_generator_set_root(generator.get(), root.get());
  gsize length = 0;
  const Owned<gchar> text(json_generator_to_data(generator.get(), &length));
  write_bytes(path, std::string(text.get(), length) + "\n");
}

}  // namespace

void put_figures(GstStructure* structure, const StreamFigures& figures) {
  gst_structure_set(structure, "events", G_TYPE_UINT64, guint64{figures.events}, "rate",
                    G_TYPE_DOUBLE, figures.rate, "on-share", G_TYPE_DOUBLE, figures.on_share,
                    "active-share", G_TYPE_DOUBLE, figures.active_share, "distinct-share",
                    G_TYPE_DOUBLE, figures.distinct_share, "mean", G_TYPE_DOUBLE, figures.mean,
                    "std-dev", G_TYPE_DOUBLE, figures.std_dev, nullptr);
  for (std::size_t i = 0; i < interval_names.size(); ++i)
    gst_structure_set(structure, interval_names[i], G_TYPE_UINT64,
                      static_cast<guint64>(figures.intervals[i]) * GST_USECOND, nullptr);
}

void put_causes(GstStructure* structure, const CauseCounts& causes) {
  static constexpr std::array names = {"unknown-events",   "light-events",
                                       "leak-events",      "shot-noise-events",
                                       "hot-pixel-events", "exposure-pulse-events"};
  static_assert(names.size() == CauseCounts::causes.size());
  if (causes.all() == 0) return;
  for (std::size_t i = 0; i < names.size(); ++i)
    gst_structure_set(structure, names[i], G_TYPE_UINT64, guint64{causes[CauseCounts::causes[i]]},
                      nullptr);
}

Nanoseconds stream_time(const GstSegment& segment, GstClockTime time) {
  guint64 result = time;
  const gint sign = gst_segment_to_stream_time_full(&segment, GST_FORMAT_TIME, time, &result);
  const auto magnitude = static_cast<Nanoseconds>(std::min<guint64>(result, G_MAXINT64));
  return sign < 0 ? -magnitude : magnitude;
}

bool can_report(gpointer element, const ReportFiles& files) {
  for (const auto& path : {files.location, files.map}) {
    const auto obstacle = obstacle_to(path);
    if (!obstacle) continue;
    GST_ELEMENT_ERROR(element, RESOURCE, OPEN_WRITE,
                      ("Cannot write \"%s\": %s", path.c_str(), obstacle->c_str()),
                      ("g_file_test() on \"%s\"", path.c_str()));
    return false;
  }
  return true;
}

void report(gpointer element, const ReportFiles& files, GstStructure* figures,
            const std::function<RgbPicture()>& draw) {
  std::string path = files.location;
  try {
    if (!path.empty()) write_json(figures, path);
    path = files.map;
    if (!path.empty()) write_bytes(path, draw().png());
  } catch (const std::exception& error) {
    GST_ELEMENT_ERROR(element, RESOURCE, WRITE,
                      ("Cannot write the statistics; check the folder and the free space."),
                      ("%s: %s", path.c_str(), error.what()));
  }
  gst_element_post_message(GST_ELEMENT(element),
                           gst_message_new_element(GST_OBJECT(element), figures));
}
