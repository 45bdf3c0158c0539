// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>

#include <memory>
#include <optional>
#include <string>

#include "gst/base/guarded.hpp"
#include "gst/simulator/caps.hpp"
#include "gst/simulator/video_simulator.hpp"
#include "src/simulate/simulator.hpp"

/// A simulation method, and its element: video in, events or event frames (accumulated-event video)
/// out.
///
/// N frames give N - 1 intervals; the first frame after start, flush or a discontinuity only serves
/// as reference for the next one. An interval has the PTS of its first frame and is pushed when its
/// last frame arrives, so the latency is one frame plus the processing time. While a GPU works on
/// an interval of a stream that is not live, it is pushed with the next frame, or before any
/// serialized event or query. With a rolling shutter, late rows of a last frame give another
/// interval. In an event stream, an interval without events is a GAP. In drawn video, an interval
/// is a picture that replaces its last frame, with that frame's timestamps and its metas that
/// remain valid, so the latency is the processing time. A first frame gives an empty picture.
struct EventSimulatorMethod {
  const char* type_name;
  const char* long_name;
  const char* description;
  /// Default of positive-threshold and negative-threshold, in grey levels; if unset, the element
  /// does not have these properties.
  std::optional<double> threshold;
  bool denoises = false;      ///< has the property denoise, off by default
  bool interpolates = false;  ///< has the property interpolated-frames
  bool labels = false;        ///< has the property label
  bool has_flow = false;      ///< reads the flow of frames, and has the property write-flow

  /// Creates the simulator of an element for frames of this format.
  std::unique_ptr<VideoSimulator> (*create)(GObject* element, const GstVideoInfo& video);

  const SimulatorVideo& video = system_memory_video;

  /// For methods with their own properties, else null: create a Guarded, install the
  /// properties, and pass the settings to the simulator before each frame.
  std::shared_ptr<void> (*make_settings)() = nullptr;
  void (*install_properties)(GObjectClass* klass) = nullptr;
  void (*configure)(eventcamera::IntervalSimulator& simulator, GObject* object) = nullptr;
  /// If set, returns why an element cannot start with its properties; empty if it can.
  std::string (*fault)(GObject* object) = nullptr;
};

extern const char* const denoise_blurb;

/// Name of the base class in the plugin that this library is linked to. Each plugin defines its
/// own.
extern const char* const event_simulator_type_name;

#define GST_TYPE_EVENT_SIMULATOR (gst_event_simulator_get_type())
G_DECLARE_DERIVABLE_TYPE(GstEventSimulator, gst_event_simulator, GST, EVENT_SIMULATOR,
                         GstBaseTransform)

struct _GstEventSimulatorClass {
  GstBaseTransformClass parent_class;
  const EventSimulatorMethod* method;
};

/// Returns the element type of `method`, which must have static storage duration: a subclass of
/// `parent`.
GType event_simulator_type(const EventSimulatorMethod& method,
                           GType parent = GST_TYPE_EVENT_SIMULATOR);

/// Acquires an output buffer from the pool of the element. `in` is the frame that it is made of.
GstFlowReturn event_simulator_prepare_buffer(GstBaseTransform* element, GstBuffer* in,
                                             GstBuffer** out);

/// Returns the result of make_settings() for an element.
void* event_simulator_settings(GObject* object);

template <class Settings>
Guarded<Settings>& event_simulator_settings(GObject* object) {
  return *static_cast<Guarded<Settings>*>(event_simulator_settings(object));
}
