// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/drawing/drawn_video.hpp"

#include <gst/video/gstvideopool.h>

#include <iterator>
#include <string_view>

#include "gst/base/element_type.hpp"

using namespace eventcamera;

PixelLayout pixel_layout_of(const GstVideoInfo& info) {
  if (GST_VIDEO_INFO_FORMAT(&info) == GST_VIDEO_FORMAT_GRAY8) return {};
  const auto place = [&info](int component) {
    return static_cast<int>(GST_VIDEO_INFO_COMP_POFFSET(&info, component));
  };
  return {.bytes = GST_VIDEO_INFO_COMP_PSTRIDE(&info, GST_VIDEO_COMP_R),
          .red = place(GST_VIDEO_COMP_R),
          .green = place(GST_VIDEO_COMP_G),
          .blue = place(GST_VIDEO_COMP_B)};
}

GType palette_type() {
  return enum_type<PaletteName>(
      "GstEventPalette",
      {{PaletteName::light, "On white: ON blue, OFF dark, both dark blue", "light"},
       {PaletteName::dark, "On dark: ON white, OFF blue, both light blue", "dark"},
       {PaletteName::grey, "On grey: ON white, OFF black, both dark grey", "grey"},
       {PaletteName::red_blue, "On white: ON blue, OFF red, both purple", "red-blue"},
       {PaletteName::viridis, "From purple through green to yellow, perceptually uniform",
        "viridis"},
       {PaletteName::magma, "From black through red to light yellow, perceptually uniform",
        "magma"}});
}

/// True if a meta of type `api` depends neither on the colours of the pixels nor on their memory
/// layout.
static bool remains_valid(GType api) {
  constexpr std::string_view kept[] = {GST_META_TAG_VIDEO_STR, GST_META_TAG_VIDEO_SIZE_STR,
                                       GST_META_TAG_VIDEO_ORIENTATION_STR};
  for (auto tags = gst_meta_api_type_get_tags(api); tags != nullptr && *tags != nullptr; ++tags)
    if (std::ranges::find(kept, std::string_view(*tags)) == std::end(kept)) return false;
  return true;
}

void keep_metas(GstBuffer* frame, GstBuffer* picture) {
  const auto keep = [](GstBuffer* from, GstMeta** meta, gpointer to) -> gboolean {
    const GstMetaInfo* info = (*meta)->info;
    GstMetaTransformCopy whole = {.region = FALSE, .offset = 0, .size = static_cast<gsize>(-1)};
    if (info->transform_func != nullptr && remains_valid(info->api))
      info->transform_func(static_cast<GstBuffer*>(to), *meta, from, _gst_meta_transform_copy,
                           &whole);
    return TRUE;
  };
  gst_buffer_foreach_meta(frame, keep, picture);
}

bool decide_on_drawn_pool(GstQuery* query, GstCaps* caps, guint kept) {
  GstVideoInfo drawn;
  if (!gst_video_info_from_caps(&drawn, caps)) return false;
  GstBufferPool* pool = nullptr;
  guint size = 0;
  guint min = 0;
  guint max = 0;
  const bool offered = gst_query_get_n_allocation_pools(query) > 0;
  if (offered) gst_query_parse_nth_allocation_pool(query, 0, &pool, &size, &min, &max);
  size = MAX(size, static_cast<guint>(GST_VIDEO_INFO_SIZE(&drawn)));
  min += kept;
  if (max > 0) max += kept;

  const auto configure = [&] {
    GstStructure* config = gst_buffer_pool_get_config(pool);
    gst_buffer_pool_config_set_params(config, caps, size, min, max);
    if (gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr))
      gst_buffer_pool_config_add_option(config, GST_BUFFER_POOL_OPTION_VIDEO_META);
    if (gst_buffer_pool_set_config(pool, config)) return true;
    // A pool may change it, for example to have more buffers.
    config = gst_buffer_pool_get_config(pool);
    if (gst_buffer_pool_config_validate_params(config, caps, size, min, max))
      return gst_buffer_pool_set_config(pool, config) != FALSE;
    gst_structure_free(config);
    return false;
  };
  if (pool == nullptr || !configure()) {
    gst_clear_object(&pool);
    pool = gst_video_buffer_pool_new();
    configure();
  }
  if (offered)
    gst_query_set_nth_allocation_pool(query, 0, pool, size, min, max);
  else
    gst_query_add_allocation_pool(query, pool, size, min, max);
  gst_object_unref(pool);
  return true;
}
