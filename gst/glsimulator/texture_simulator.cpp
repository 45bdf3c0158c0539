// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gst/gl/gl.h>
#include <gst/gl/gstglfuncs.h>
#include <gst/video/video.h>

#include <iterator>

#include "gst/glsimulator/gleventsimulator.hpp"
#include "gst/glsimulator/shared_context.hpp"
#include "gst/simulator/frame_luma.hpp"

using eventcamera::LumaWeights;
using eventcamera::Nanoseconds;

namespace {

/// Maps the first texture of a frame or a picture.
class MappedTexture {
 public:
  /// Reason why a context cannot use the first texture of a buffer; empty if it can.
  static std::string fault_of(const GstVideoInfo& video, GstBuffer* buffer, GstGLContext* context) {
    GstMemory* memory =
        gst_buffer_n_memory(buffer) > 0 ? gst_buffer_peek_memory(buffer, 0) : nullptr;
    if (memory == nullptr || !gst_is_gl_memory(memory))
      return "its memory is not an OpenGL texture";
    auto* texture = GST_GL_MEMORY_CAST(memory);
    if (!gst_gl_context_can_share(texture->mem.context, context))
      return "its texture is in an OpenGL context that is not shared with this element";
    if (gst_gl_memory_get_texture_target(texture) != GST_GL_TEXTURE_TARGET_2D ||
        gst_gl_memory_get_texture_width(texture) < GST_VIDEO_INFO_WIDTH(&video) ||
        gst_gl_memory_get_texture_height(texture) < GST_VIDEO_INFO_HEIGHT(&video))
      return "its texture is not 2D, or smaller than the caps say";
    return "";
  }

  MappedTexture(const GstVideoInfo& video, GstBuffer* buffer, GstGLContext* context,
                GstMapFlags access)
      : fault_(fault_of(video, buffer, context)) {
    if (!fault_.empty()) return;
    if (auto* sync = gst_buffer_get_gl_sync_meta(buffer)) gst_gl_sync_meta_wait(sync, context);
    memory_ = gst_buffer_peek_memory(buffer, 0);
    if (!gst_memory_map(memory_, &map_, static_cast<GstMapFlags>(access | GST_MAP_GL))) {
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

void describe_channels(const GstVideoInfo& video, eventcamera::gl::TextureFrame& frame) {
  const auto channel = [&](guint component) -> int& {
    return frame.weights[GST_VIDEO_INFO_COMP_POFFSET(&video, component)];
  };
  frame.black = has_narrow_luma(video) ? 16 : 0;
  frame.alpha =
      GST_VIDEO_INFO_HAS_ALPHA(&video) ? GST_VIDEO_INFO_COMP_POFFSET(&video, GST_VIDEO_COMP_A) : -1;
  std::fill(std::begin(frame.weights), std::end(frame.weights), 0);
  if (GST_VIDEO_INFO_IS_RGB(&video)) {
    const auto luma = luma_weights_of(video);
    channel(GST_VIDEO_COMP_R) = luma.red;
    channel(GST_VIDEO_COMP_G) = luma.green;
    channel(GST_VIDEO_COMP_B) = luma.blue;
  } else {
    channel(GST_VIDEO_COMP_Y) = LumaWeights::one;
  }
}

/// A simulator on the GPU. The events of an interval are read once the next frame has been queued,
/// so that the GPU has work while they are read and pushed; finish() reads them before. Both wait
/// for a fence in the streaming thread: the thread of the context works for other elements, too.
/// Only without EGL do they wait in that thread. Every frame, including first and drawn ones, is
/// held until its fence has been reached.
class TextureVideoSimulator final : public VideoSimulator {
 public:
  /// `context` belongs to `shared`, which must outlive this object.
  TextureVideoSimulator(GstElement* element, SharedContext& shared, GstGLContext* context,
                        const GstVideoInfo& video, MakeGlSimulator make)
      : element_(element),
        shared_(shared),
        context_(static_cast<GstGLContext*>(gst_object_ref(context))),
        frame_{FrameLuma::format_of(video), 0, {}} {
    set_video(video);
    try {
      run([&] {
        gl_.emplace(
            [context](const char* name) { return gst_gl_context_get_proc_address(context, name); });
        simulator_ = make(*gl_, frame_.format);
        const auto* functions = context_->gl_vtable;
        GST_CAT_INFO_OBJECT(shared_.category(), element_, "%s, OpenGL %s",
                            functions->GetString(GL_RENDERER), functions->GetString(GL_VERSION));
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
    describe_channels(video, frame_);
    gst_clear_object(&upload_);
  }

  void set_drawn_video(const GstVideoInfo& drawn) override { drawn_ = drawn; }

  std::optional<Interval> push(Interval interval, const eventcamera::Settings& settings,
                               const KnownFlow& flow) override {
    {
      const OwnedBuffer uploaded = in_texture(interval.frame.get());
      const MappedTexture texture(video_, uploaded.get(), context_, GST_MAP_READ);
      if (!texture.fault().empty()) refuse(cannot_read(texture.fault()), texture.fault());
      frame_.texture = texture.name();
      simulator_->set_flow(flow);
      run([&] { simulator_->queue(frame_, interval.end, settings); });
    }
    return finish_before({std::move(interval), false});
  }

  void draw(OwnedBuffer frame, Nanoseconds time, const eventcamera::Settings& settings,
            const KnownFlow& flow, const eventcamera::Palette& palette,
            GstBuffer* picture) override {
    {
      const OwnedBuffer uploaded = in_texture(frame.get());
      const MappedTexture texture(video_, uploaded.get(), context_, GST_MAP_READ);
      if (!texture.fault().empty()) refuse(cannot_read(texture.fault()), texture.fault());
      const MappedTexture drawn(drawn_, picture, context_, GST_MAP_WRITE);
      if (!drawn.fault().empty()) refuse(cannot_draw(drawn.fault()), drawn.fault());
      frame_.texture = texture.name();
      const eventcamera::gl::Picture out{
          drawn.name(), eventcamera::pixels_by_kind(palette, pixel_layout_of(drawn_))};
      simulator_->set_flow(flow);
      run([&] { simulator_->draw(frame_, time, settings, out); });
    }
    // Makes readers of the picture in another context wait until it is drawn.
    auto* sync = gst_buffer_get_gl_sync_meta(picture);
    if (sync == nullptr) sync = gst_buffer_add_gl_sync_meta(context_, picture);
    gst_gl_sync_meta_set_sync_point(sync, context_);
    finish_before({{std::move(frame), time, time}, true});
  }

  std::optional<Interval> finish() override {
    if (!queued_) return std::nullopt;
    Queued done = *std::exchange(queued_, std::nullopt);
    simulator_->wait();
    run([&] { done.interval.events = simulator_->read(); });
    if (done.is_drawn || done.interval.events == nullptr) return std::nullopt;
    return std::move(done.interval);
  }

  void drop() override {
    queued_.reset();
    simulator_->drop();
  }

  const eventcamera::EventBuckets* hold_until(Nanoseconds time,
                                              const eventcamera::Settings& settings) override {
    const eventcamera::EventBuckets* events = nullptr;
    run([&] { events = simulator_->hold_until(time, settings); });
    return events;
  }

  eventcamera::IntervalSimulator& simulator() override { return *simulator_; }

 private:
  struct Queued {
    Interval interval;
    bool is_drawn;
  };

  /// Finishes the interval before the frame that was queued last, if any, and returns it.
  std::optional<Interval> finish_before(Queued queued) {
    auto finished = finish();
    queued_ = std::move(queued);
    return finished;
  }

  /// Returns a frame that GstGLUpload can upload: it does not check that frames can be mapped, and
  /// passes textures on unchanged.
  OwnedBuffer in_system_memory(GstBuffer* buffer) const {
    const VideoFrame mapped(video_, buffer, GST_MAP_READ);
    if (!mapped) throw VideoSimulatorError(cannot_read(mapped.fault()), mapped.fault());
    if (!gst_is_gl_memory(gst_buffer_peek_memory(buffer, 0)))
      return OwnedBuffer(gst_buffer_ref(buffer));
    OwnedBuffer copy(gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&video_), nullptr));
    GstVideoFrame to;
    if (!copy || !gst_video_frame_map(&to, &video_, copy.get(), GST_MAP_WRITE))
      throw std::bad_alloc();
    gst_video_frame_copy(&to, mapped.get());
    gst_video_frame_unmap(&to);
    return copy;
  }

  /// Returns the frame as a texture that the context can use; uploads others.
  OwnedBuffer in_texture(GstBuffer* buffer) {
    if (MappedTexture::fault_of(video_, buffer, context_).empty())
      return OwnedBuffer(gst_buffer_ref(buffer));
    const OwnedBuffer in_memory = in_system_memory(buffer);
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
    auto result = gst_gl_upload_perform_with_buffer(upload_, in_memory.get(), &uploaded);
    if (result == GST_GL_UPLOAD_RECONFIGURE)  // it has selected an upload method
      result = gst_gl_upload_perform_with_buffer(upload_, in_memory.get(), &uploaded);
    const std::string fault = "it cannot be uploaded to an OpenGL texture";
    if (result != GST_GL_UPLOAD_DONE) refuse(cannot_read(fault), fault);
    return OwnedBuffer(uploaded);
  }

  /// Throws the fault of a frame or a picture, or ContextLost if the context is the cause.
  [[noreturn]] void refuse(const Report& report, const std::string& cause) {
    run([] {});
    throw VideoSimulatorError(report, cause);
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
        shared_.forget(context_);
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
  SharedContext& shared_;
  std::optional<Queued> queued_;
  GstGLContext* context_;
  GstVideoInfo video_;
  GstVideoInfo drawn_{};
  GstGLUpload* upload_ = nullptr;  ///< for video in system memory
  eventcamera::gl::TextureFrame frame_;
  std::optional<eventcamera::gl::Context> gl_;
  std::unique_ptr<eventcamera::gl::Simulator> simulator_;
};

}  // namespace

std::unique_ptr<VideoSimulator> in_gl_memory(GObject* object, const GstVideoInfo& video,
                                             MakeGlSimulator make) {
  GstElement* const element = GST_ELEMENT(object);
  SharedContext& shared = context_of(element);
  GError* error = nullptr;
  GstGLContext* context = shared.find(&error);
  if (context == nullptr) {
    const std::string cause = error != nullptr ? error->message : "unknown";
    g_clear_error(&error);
    throw VideoSimulatorError(
        {GST_RESOURCE_ERROR_NOT_FOUND,
         "Cannot create an OpenGL context. Without a screen, set the environment variable "
         "GST_GL_WINDOW=egl-device, which other elements of OpenGL need, too." +
             advice_of(element)},
        cause);
  }
  return std::make_unique<TextureVideoSimulator>(element, shared, context, video, make);
}
