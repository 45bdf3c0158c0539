// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gl/gl.h>
#include <gst/video/video.h>

#include <string>

/// Maps the first texture of a frame or a picture.
class MappedTexture {
 public:
  /// Description of what keeps a context from using the first texture of a buffer; empty if
  /// nothing does.
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
