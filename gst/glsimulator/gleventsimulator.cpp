// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/glsimulator/gleventsimulator.hpp"

#include <gst/gl/gstglfuncs.h>

#include <exception>
#include <mutex>
#include <new>
#include <string>
#include <utility>

#include "gst/base/owned.hpp"
#include "gst/base/video_frame.hpp"
#include "gst/glsimulator/gl_display.hpp"
#include "gst/simulator/frame_luma.hpp"

GST_DEBUG_CATEGORY_STATIC(gl_event_simulator_debug);
#define GST_CAT_DEFAULT gl_event_simulator_debug

using eventcamera::EventBuckets;
using eventcamera::LumaWeights;
using eventcamera::Nanoseconds;

/// Guarded by `mutex`, because contexts are set and queried from any thread.
struct GstGLEventSimulatorPrivate {
  std::recursive_mutex mutex;
  GstGLDisplay* display = nullptr;
  GstGLContext* other = nullptr;  ///< of the application, to share objects with
  GstGLContext* context = nullptr;
};

G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstGLEventSimulator, gst_gl_event_simulator,
                                 GST_TYPE_EVENT_SIMULATOR,
                                 G_ADD_PRIVATE(GstGLEventSimulator)
                                     GST_DEBUG_CATEGORY_INIT(gl_event_simulator_debug,
                                                             "gleventsimulator", 0,
                                                             "event simulators on the GPU"))
#define PARENT_ELEMENT_CLASS GST_ELEMENT_CLASS(gst_gl_event_simulator_parent_class)
#define PARENT_TRANSFORM_CLASS GST_BASE_TRANSFORM_CLASS(gst_gl_event_simulator_parent_class)

static GstGLEventSimulatorPrivate& priv_of(gpointer self) {
  return *static_cast<GstGLEventSimulatorPrivate*>(
      gst_gl_event_simulator_get_instance_private(GST_GL_EVENT_SIMULATOR(self)));
}

/// Advice if OpenGL is unavailable: use the element on the CPU, which has the same name without
/// "gl".
static std::string advice_of(gpointer self) {
  const auto* factory = gst_element_get_factory(GST_ELEMENT(self));
  if (factory == nullptr) return " Use the element that runs on the CPU.";
  return std::string(" Use ") + (GST_OBJECT_NAME(factory) + 2) + ", which runs on the CPU.";
}

/* display and context */

/// Asks the neighbours and the application for an object, which set_context() then stores. Returns
/// true if there is one. Must be called without the lock: neighbours may query this element.
template <class Object>
static bool ask_for(GstElement* self, const char* type,
                    Object* GstGLEventSimulatorPrivate::*object) {
  const auto is_known = [&priv = priv_of(self), object] {
    const std::lock_guard lock(priv.mutex);
    return priv.*object != nullptr;
  };
  GstQuery* query = gst_query_new_context(type);
  for (GstPad* pad : {GST_BASE_TRANSFORM_SRC_PAD(self), GST_BASE_TRANSFORM_SINK_PAD(self)}) {
    GstContext* context = nullptr;
    if (!is_known() && gst_pad_peer_query(pad, query)) {
      gst_query_parse_context(query, &context);
      if (context != nullptr) gst_element_set_context(self, context);
    }
  }
  gst_query_unref(query);
  if (!is_known())
    gst_element_post_message(self, gst_message_new_need_context(GST_OBJECT(self), type));
  return is_known();
}

/// Makes a display, and shares it with the pipeline. False if there is none.
static bool provide_display(GstElement* self) {
  GstGLDisplay* display = gl_display();
  if (display == nullptr) return false;
  GstContext* context = gst_context_new(GST_GL_DISPLAY_CONTEXT_TYPE, TRUE);
  gst_context_set_gl_display(context, display);
  gst_object_unref(display);
  gst_element_set_context(self, context);
  gst_element_post_message(self, gst_message_new_have_context(GST_OBJECT(self), context));
  return true;
}

static bool open_display(GstElement* self) {
  using Private = GstGLEventSimulatorPrivate;
  if (ask_for(self, GST_GL_DISPLAY_CONTEXT_TYPE, &Private::display) || provide_display(self)) {
    ask_for(self, "gst.gl.app_context", &Private::other);
    return true;
  }
  post_message(self, GST_MESSAGE_ERROR,
               {GST_RESOURCE_ERROR_NOT_FOUND,
                "OpenGL does not work here: there is no screen, no GPU and no software renderer "
                "(Debian: libgl1-mesa-dri)." +
                    advice_of(self)},
               "no GstGLDisplay has a context");
  return false;
}

static void close_display(gpointer self) {
  auto& priv = priv_of(self);
  const std::lock_guard lock(priv.mutex);
  gst_clear_object(&priv.context);
  gst_clear_object(&priv.other);
  gst_clear_object(&priv.display);
}

/// Returns the context shared with the neighbours, or else that of the display; null with an error
/// if there is none.
static GstGLContext* find_context(GstElement* self, GError** error) {
  auto& priv = priv_of(self);
  {
    const std::lock_guard lock(priv.mutex);
    if (priv.context != nullptr) return priv.context;
  }
  GstGLContext* shared = nullptr;  // asked for without the lock: neighbours may query this element
  gst_gl_query_local_gl_context(self, GST_PAD_SRC, &shared);
  if (shared == nullptr) gst_gl_query_local_gl_context(self, GST_PAD_SINK, &shared);

  const std::lock_guard lock(priv.mutex);
  if (priv.context == nullptr) std::swap(priv.context, shared);
  if (priv.context == nullptr) priv.context = gl_context_of(priv.display, priv.other, error);
  gst_clear_object(&shared);
  return priv.context;
}

/// Makes find_context() replace this context, which is lost.
static void forget_context(GstElement* self, GstGLContext* context) {
  auto& priv = priv_of(self);
  const std::lock_guard lock(priv.mutex);
  if (priv.context != context) return;
  GST_WARNING_OBJECT(self, "lost %" GST_PTR_FORMAT ", looking for another", context);
  GST_OBJECT_LOCK(priv.display);
  gst_gl_display_remove_context(priv.display, context);
  GST_OBJECT_UNLOCK(priv.display);
  gst_clear_object(&priv.context);
  gst_pad_mark_reconfigure(GST_BASE_TRANSFORM_SRC_PAD(self));  // its textures are lost, too
}

static void set_context(GstElement* self, GstContext* context) {
  auto& priv = priv_of(self);
  {
    const std::lock_guard lock(priv.mutex);
    gst_gl_handle_set_context(self, context, &priv.display, &priv.other);
  }
  PARENT_ELEMENT_CLASS->set_context(self, context);
}

static GstStateChangeReturn change_state(GstElement* self, GstStateChange change) {
  if (change == GST_STATE_CHANGE_NULL_TO_READY && !open_display(self))
    return GST_STATE_CHANGE_FAILURE;
  const auto result = PARENT_ELEMENT_CLASS->change_state(self, change);
  if (change == GST_STATE_CHANGE_READY_TO_NULL) close_display(self);
  return result;
}

static gboolean query(GstBaseTransform* self, GstPadDirection direction, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_CONTEXT) {
    auto& priv = priv_of(self);
    const std::lock_guard lock(priv.mutex);
    if (gst_gl_handle_context_query(GST_ELEMENT(self), query, priv.display, priv.context,
                                    priv.other))
      return TRUE;
  }
  return PARENT_TRANSFORM_CLASS->query(self, direction, query);
}

/* frames */

namespace {

/// Runs `work` in the thread of a context, and rethrows its exceptions. Returns false if the
/// context no longer has a thread.
template <class Work>
bool run_in(GstGLContext* context, const Work& work) {
  struct Call {
    const Work& work;
    bool has_run;
    std::exception_ptr failure;
  } call{work, false, nullptr};
  const auto run = [](GstGLContext*, gpointer data) {
    auto& this_call = *static_cast<Call*>(data);
    this_call.has_run = true;
    try {
      this_call.work();
    } catch (...) {
      this_call.failure = std::current_exception();
    }
  };
  gst_gl_context_thread_add(context, run, &call);
  if (call.failure) std::rethrow_exception(call.failure);
  return call.has_run;
}

/// Weights of the channels of the first texture in luma.
void find_weights(const GstVideoInfo& video, int (&weights)[4]) {
  const auto channel = [&](guint component) -> int& {
    return weights[GST_VIDEO_INFO_COMP_POFFSET(&video, component)];
  };
  std::fill(std::begin(weights), std::end(weights), 0);
  if (GST_VIDEO_INFO_IS_RGB(&video)) {
    const auto luma = luma_weights_of(video);
    channel(GST_VIDEO_COMP_R) = luma.red;
    channel(GST_VIDEO_COMP_G) = luma.green;
    channel(GST_VIDEO_COMP_B) = luma.blue;
  } else {
    channel(GST_VIDEO_COMP_Y) = LumaWeights::one;
  }
}

/// Maps the first texture of a frame or a picture.
class MappedTexture {
 public:
  MappedTexture(const GstVideoInfo& video, GstBuffer* buffer, GstGLContext* context,
                GstMapFlags access) {
    GstMemory* memory =
        gst_buffer_n_memory(buffer) > 0 ? gst_buffer_peek_memory(buffer, 0) : nullptr;
    if (memory == nullptr || !gst_is_gl_memory(memory)) {
      fault_ = "its memory is not an OpenGL texture";
      return;
    }
    auto* texture = GST_GL_MEMORY_CAST(memory);
    if (!gst_gl_context_can_share(texture->mem.context, context)) {
      fault_ = "its texture is in an OpenGL context that is not shared with this element";
      return;
    }
    if (gst_gl_memory_get_texture_target(texture) != GST_GL_TEXTURE_TARGET_2D ||
        gst_gl_memory_get_texture_width(texture) < GST_VIDEO_INFO_WIDTH(&video) ||
        gst_gl_memory_get_texture_height(texture) < GST_VIDEO_INFO_HEIGHT(&video)) {
      fault_ = "its texture is not 2D, or smaller than the caps say";
      return;
    }
    if (auto* sync = gst_buffer_get_gl_sync_meta(buffer)) gst_gl_sync_meta_wait(sync, context);
    memory_ = memory;
    if (!gst_memory_map(memory, &map_, static_cast<GstMapFlags>(access | GST_MAP_GL))) {
      memory_ = nullptr;
      fault_ = "its texture cannot be mapped";
    }
  }
  ~MappedTexture() {
    if (memory_ != nullptr) gst_memory_unmap(memory_, &map_);
  }
  MappedTexture(const MappedTexture&) = delete;
  MappedTexture& operator=(const MappedTexture&) = delete;

  /// Description of the fault, for a message; empty if the texture was mapped.
  const std::string& fault() const { return fault_; }
  guint name() const { return *reinterpret_cast<const guint*>(map_.data); }

 private:
  GstMemory* memory_ = nullptr;
  GstMapInfo map_{};
  std::string fault_;
};

/// Interval at which to check whether the GPU has finished.
constexpr GstClockTime look_interval = GST_MSECOND;

/// Makes the simulator of an element push finished intervals, a little later.
class LaterLook {
 public:
  explicit LaterLook(GstElement* element) : element_(element) {}
  ~LaterLook() { cancel(); }
  LaterLook(const LaterLook&) = delete;
  LaterLook& operator=(const LaterLook&) = delete;

  /// Schedules a check, and cancels the pending one, if any.
  void schedule() {
    cancel();
    GstClock* clock = gst_system_clock_obtain();
    id_ = gst_clock_new_single_shot_id(clock, gst_clock_get_time(clock) + look_interval);
    gst_object_unref(clock);
    auto* element = g_new0(GWeakRef, 1);
    g_weak_ref_init(element, element_);
    gst_clock_id_wait_async(id_, look, element, [](gpointer data) {
      g_weak_ref_clear(static_cast<GWeakRef*>(data));
      g_free(data);
    });
  }

  void cancel() {
    if (id_ == nullptr) return;
    gst_clock_id_unschedule(id_);
    gst_clock_id_unref(std::exchange(id_, nullptr));
  }

 private:
  /// Called in the thread of the clock, which must not wait for the stream lock or the GPU.
  static gboolean look(GstClock*, GstClockTime, GstClockID, gpointer data) {
    auto* element = static_cast<GstElement*>(g_weak_ref_get(static_cast<GWeakRef*>(data)));
    if (element == nullptr) return TRUE;
    gst_element_call_async(
        element, [](GstElement* self, gpointer) { event_simulator_push_finished(self); }, nullptr,
        nullptr);
    gst_object_unref(element);
    return TRUE;
  }

  GstElement* element_;
  GstClockID id_ = nullptr;
};

/// A simulator on the GPU. The events of an interval are read while the GPU works on the next one,
/// or as soon as they are ready, so at most one interval is awaited. Every frame, including first
/// and drawn ones, is held until the GPU has read it.
class TextureVideoSimulator final : public VideoSimulator {
 public:
  TextureVideoSimulator(GstElement* element, GstGLContext* context, const GstVideoInfo& video,
                        MakeGlSimulator make)
      : element_(element),
        later_look_(element),
        context_(static_cast<GstGLContext*>(gst_object_ref(context))),
        frame_{FrameLuma::format_of(video), 0, {}} {
    set_video(video);
    try {
      run([&] {
        gl_.emplace(
            [context](const char* name) { return gst_gl_context_get_proc_address(context, name); });
        simulator_ = make(*gl_, frame_.format);
        const auto* functions = context_->gl_vtable;
        GST_INFO_OBJECT(element_, "%s, OpenGL %s", functions->GetString(GL_RENDERER),
                        functions->GetString(GL_VERSION));
      });
    } catch (...) {
      close();
      throw;
    }
  }
  ~TextureVideoSimulator() override { close(); }
  TextureVideoSimulator(const TextureVideoSimulator&) = delete;
  TextureVideoSimulator& operator=(const TextureVideoSimulator&) = delete;

  void set_video(const GstVideoInfo& video) override {
    video_ = video;
    find_weights(video, frame_.weights);
    gst_clear_object(&upload_);
  }

  void set_drawn_video(const GstVideoInfo& drawn) override { drawn_ = drawn; }

  void push(Interval interval, const eventcamera::Settings& settings) override {
    {
      const OwnedBuffer uploaded = in_texture(interval.frame.get());
      const MappedTexture texture(video_, uploaded.get(), context_, GST_MAP_READ);
      if (!texture.fault().empty()) refuse(cannot_read(texture.fault()));
      frame_.texture = texture.name();
      run([&] { simulator_->queue(frame_, interval.end, settings); });
    }
    await({std::move(interval), false});
  }

  void draw(OwnedBuffer frame, Nanoseconds time, const eventcamera::Settings& settings,
            const eventcamera::Palette& palette, GstBuffer* picture) override {
    {
      const OwnedBuffer uploaded = in_texture(frame.get());
      const MappedTexture texture(video_, uploaded.get(), context_, GST_MAP_READ);
      if (!texture.fault().empty()) refuse(cannot_read(texture.fault()));
      const MappedTexture drawn(drawn_, picture, context_, GST_MAP_WRITE);
      if (!drawn.fault().empty()) refuse(cannot_draw(drawn.fault()));
      frame_.texture = texture.name();
      const eventcamera::gl::Picture out{
          drawn.name(), eventcamera::pixels_by_kind(palette, pixel_layout_of(drawn_))};
      run([&] { simulator_->draw(frame_, time, settings, out); });
    }
    // Makes readers of the picture in another context wait until it is drawn.
    auto* sync = gst_buffer_get_gl_sync_meta(picture);
    if (sync == nullptr) sync = gst_buffer_add_gl_sync_meta(context_, picture);
    gst_gl_sync_meta_set_sync_point(sync, context_);
    await({{.frame = std::move(frame)}, true});
  }

  void push_finished() override {
    if (!awaited_) return;
    bool is_ready = false;
    run([&] { is_ready = simulator_->is_ready(); });
    if (is_ready)
      finish();
    else
      later_look_.schedule();
  }

  void finish() override {
    if (!awaited_) return;
    later_look_.cancel();
    auto [interval, is_drawn] = *std::exchange(awaited_, std::nullopt);
    const EventBuckets* events = nullptr;
    run([&] { events = simulator_->read(); });
    if (!is_drawn) event_simulator_push_interval(G_OBJECT(element_), std::move(interval), events);
  }

  void drop() override {
    later_look_.cancel();
    awaited_.reset();
    simulator_->drop();
  }

  eventcamera::IntervalSimulator& simulator() override { return *simulator_; }

 private:
  struct Awaited {
    Interval interval;
    bool is_drawn;
  };

  /// Awaits the frame queued last, after pushing the previous interval.
  void await(Awaited awaited) {
    finish();
    awaited_ = std::move(awaited);
    push_finished();
  }

  /// Returns the frame as a texture; uploads it if it is in system memory.
  OwnedBuffer in_texture(GstBuffer* buffer) {
    if (gst_buffer_n_memory(buffer) > 0 && gst_is_gl_memory(gst_buffer_peek_memory(buffer, 0)))
      return OwnedBuffer(gst_buffer_ref(buffer));
    if (const VideoFrame mapped(video_, buffer, GST_MAP_READ); !mapped)  // GstGLUpload trusts it
      throw cannot_read(mapped.fault());
    if (upload_ == nullptr) {
      upload_ = gst_gl_upload_new(context_);
      const OwnedCaps from(gst_video_info_to_caps(&video_));
      const OwnedCaps to(gst_caps_copy(from.get()));
      gst_caps_set_features_simple(
          to.get(), gst_caps_features_new(GST_CAPS_FEATURE_MEMORY_GL_MEMORY, nullptr));
      gst_caps_set_simple(to.get(), "texture-target", G_TYPE_STRING, GST_GL_TEXTURE_TARGET_2D_STR,
                          nullptr);
      gst_gl_upload_set_caps(upload_, from.get(), to.get());
    }
    GstBuffer* uploaded = nullptr;
    auto result = gst_gl_upload_perform_with_buffer(upload_, buffer, &uploaded);
    if (result == GST_GL_UPLOAD_RECONFIGURE)  // it has selected an upload method
      result = gst_gl_upload_perform_with_buffer(upload_, buffer, &uploaded);
    if (result != GST_GL_UPLOAD_DONE)
      refuse(cannot_read("it cannot be uploaded to an OpenGL texture"));
    return OwnedBuffer(uploaded);
  }

  /// Throws the fault of a frame or a picture, or ContextLost if the context is the cause.
  [[noreturn]] void refuse(const VideoSimulatorError& fault) {
    run([] {});
    throw fault;
  }

  /// Runs `work` in the context, which other elements share; turns OpenGL errors into messages.
  template <class Work>
  void run(const Work& work) {
    try {
      const bool has_run = run_in(context_, [&] {
        if (gl_) gl_->forget_errors();
        work();
        gst_gl_context_clear_shader(context_);
      });
      if (!has_run) throw eventcamera::gl::ContextLost("the OpenGL context was destroyed");
    } catch (const eventcamera::gl::Error& error) {
      if (dynamic_cast<const eventcamera::gl::ContextLost*>(&error) != nullptr)
        forget_context(element_, context_);
      gint major = 0;
      gint minor = 0;
      gst_gl_context_get_gl_version(context_, &major, &minor);
      gchar* api = gst_gl_api_to_string(gst_gl_context_get_gl_api(context_));
      const std::string version =
          std::string(api) + " " + std::to_string(major) + "." + std::to_string(minor);
      g_free(api);
      throw VideoSimulatorError(
          {GST_RESOURCE_ERROR_FAILED,
           std::string("OpenGL cannot simulate: ") + error.what() + "." + advice_of(element_)},
          version);
    }
  }

  void close() {
    const auto destroy = [this] {
      simulator_.reset();
      gl_.reset();
    };
    if (!run_in(context_, destroy)) {
      if (gl_) gl_->abandon();
      destroy();
    }
    gst_clear_object(&upload_);
    gst_object_unref(context_);
  }

  GstElement* element_;
  LaterLook later_look_;
  std::optional<Awaited> awaited_;
  GstGLContext* context_;
  GstVideoInfo video_;
  GstVideoInfo drawn_{};
  GstGLUpload* upload_ = nullptr;  ///< for video in system memory
  eventcamera::gl::TextureFrame frame_;
  std::optional<eventcamera::gl::Context> gl_;
  std::unique_ptr<eventcamera::gl::Simulator> simulator_;
};

}  // namespace

std::unique_ptr<VideoSimulator> make_texture_simulator(GObject* element, const GstVideoInfo& video,
                                                       MakeGlSimulator make) {
  auto* self = GST_ELEMENT(element);
  GError* error = nullptr;
  GstGLContext* context = find_context(self, &error);
  if (context == nullptr) {
    const std::string cause = error != nullptr ? error->message : "unknown";
    g_clear_error(&error);
    throw VideoSimulatorError(
        {GST_RESOURCE_ERROR_NOT_FOUND,
         "Cannot create an OpenGL context. Without a screen, set the environment variable "
         "GST_GL_WINDOW=egl-device, which other elements of OpenGL need, too." +
             advice_of(self)},
        cause);
  }
  return std::make_unique<TextureVideoSimulator>(self, context, video, make);
}

/* allocation */

/// Proposes no pool, because upstream's textures may be of another context.
static gboolean propose_allocation(GstBaseTransform* self, GstQuery* decide, GstQuery* query) {
  gst_query_add_allocation_meta(query, GST_GL_SYNC_META_API_TYPE, nullptr);
  return PARENT_TRANSFORM_CLASS->propose_allocation(self, decide, query);
}

/// Puts a pool of textures first: downstream's, if the context can draw in its textures.
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
    GstGLContext* const context = find_context(GST_ELEMENT(self), nullptr);
    if (context == nullptr) return FALSE;
    choose_texture_pool(query, caps, context);
  }
  return PARENT_TRANSFORM_CLASS->decide_allocation(self, query);
}

/* type */

static void finalize(GObject* object) {
  close_display(object);
  std::destroy_at(&priv_of(object));
  G_OBJECT_CLASS(gst_gl_event_simulator_parent_class)->finalize(object);
}

static void gst_gl_event_simulator_init(GstGLEventSimulator* self) {
  std::construct_at(&priv_of(self));
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
