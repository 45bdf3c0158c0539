// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/glsimulator/gleventsimulator.hpp"

#include "gst/glsimulator/shared_context.hpp"

GST_DEBUG_CATEGORY_STATIC(gl_event_simulator_debug);
#define GST_CAT_DEFAULT gl_event_simulator_debug

using GstGLEventSimulatorPrivate = SharedContext;

G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstGLEventSimulator, gst_gl_event_simulator,
                                 GST_TYPE_EVENT_SIMULATOR,
                                 G_ADD_PRIVATE(GstGLEventSimulator)
                                     GST_DEBUG_CATEGORY_INIT(gl_event_simulator_debug,
                                                             "gleventsimulator", 0,
                                                             "event simulators on the GPU"))
#define PARENT_ELEMENT_CLASS GST_ELEMENT_CLASS(gst_gl_event_simulator_parent_class)
#define PARENT_TRANSFORM_CLASS GST_BASE_TRANSFORM_CLASS(gst_gl_event_simulator_parent_class)

SharedContext& context_of(gpointer self) {
  return *static_cast<SharedContext*>(
      gst_gl_event_simulator_get_instance_private(GST_GL_EVENT_SIMULATOR(self)));
}

static void set_context(GstElement* self, GstContext* context) {
  context_of(self).set_context(context);
  PARENT_ELEMENT_CLASS->set_context(self, context);
}

static GstStateChangeReturn change_state(GstElement* self, GstStateChange change) {
  if (change == GST_STATE_CHANGE_NULL_TO_READY && !context_of(self).open())
    return GST_STATE_CHANGE_FAILURE;
  const auto result = PARENT_ELEMENT_CLASS->change_state(self, change);
  if (change == GST_STATE_CHANGE_READY_TO_NULL) context_of(self).close();
  return result;
}

static gboolean query(GstBaseTransform* self, GstPadDirection direction, GstQuery* query) {
  if (context_of(self).answer(query)) return TRUE;
  return PARENT_TRANSFORM_CLASS->query(self, direction, query);
}

/// Proposes no pool, because upstream's textures may belong to another context.
static gboolean propose_allocation(GstBaseTransform* self, GstQuery* decide, GstQuery* query) {
  gst_query_add_allocation_meta(query, GST_GL_SYNC_META_API_TYPE, nullptr);
  return PARENT_TRANSFORM_CLASS->propose_allocation(self, decide, query);
}

static void choose_texture_pool(GstQuery* query, GstCaps* caps, GstGLContext* context) {
  GstBufferPool* pool = nullptr;
  guint size = 0;
  guint min = 0;
  guint max = 0;
  const bool offered = gst_query_get_n_allocation_pools(query) > 0;
  if (offered) gst_query_parse_nth_allocation_pool(query, 0, &pool, &size, &min, &max);
  if (pool == nullptr || !GST_IS_GL_BUFFER_POOL(pool) ||
      !gst_gl_context_can_share(GST_GL_BUFFER_POOL(pool)->context, context)) {
    gst_clear_object(&pool);
    pool = gst_gl_buffer_pool_new(context);
  }
  GstStructure* config = gst_buffer_pool_get_config(pool);
  gst_buffer_pool_config_set_params(config, caps, size, min, max);
  gst_buffer_pool_config_add_option(config, GST_BUFFER_POOL_OPTION_GL_SYNC_META);
  gst_buffer_pool_set_config(pool, config);
  if (offered)
    gst_query_set_nth_allocation_pool(query, 0, pool, size, min, max);
  else
    gst_query_add_allocation_pool(query, pool, size, min, max);
  gst_object_unref(pool);
}

static gboolean decide_allocation(GstBaseTransform* self, GstQuery* query) {
  GstCaps* caps = nullptr;
  gst_query_parse_allocation(query, &caps, nullptr);
  if (event_simulator_draws(caps)) {
    GstGLContext* const context = context_of(self).find(nullptr);
    if (context == nullptr) return FALSE;
    choose_texture_pool(query, caps, context);
  }
  return PARENT_TRANSFORM_CLASS->decide_allocation(self, query);
}

static void finalize(GObject* object) {
  std::destroy_at(&context_of(object));
  G_OBJECT_CLASS(gst_gl_event_simulator_parent_class)->finalize(object);
}

static void gst_gl_event_simulator_init(GstGLEventSimulator* self) {
  std::construct_at(&context_of(self), GST_BASE_TRANSFORM(self), GST_CAT_DEFAULT);
}

static void gst_gl_event_simulator_class_init(GstGLEventSimulatorClass* klass) {
  G_OBJECT_CLASS(klass)->finalize = finalize;
  GST_ELEMENT_CLASS(klass)->set_context = set_context;
  GST_ELEMENT_CLASS(klass)->change_state = change_state;
  auto* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->query = query;
  transform_class->propose_allocation = propose_allocation;
  transform_class->decide_allocation = decide_allocation;
  gst_type_mark_as_plugin_api(GST_TYPE_GL_EVENT_SIMULATOR, static_cast<GstPluginAPIFlags>(0));
}
