// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>

#include <memory>

#include "src/simulate/simulator.hpp"

/// The abstract base class of the simulator elements: video in, events or accumulated-event video
/// out. It does all that GStreamer asks for; a subclass brings a Simulator and its properties.
///
/// N frames give N - 1 intervals, the first frame after start, flush or a discontinuity being the
/// one that the next is compared to. An interval has the PTS of its first frame and comes out with
/// its last, so the latency is one frame. In the event stream an interval without events is a GAP.
#define GST_TYPE_EVENT_SIMULATOR (gst_event_simulator_get_type())
#define GST_EVENT_SIMULATOR(object) \
  (G_TYPE_CHECK_INSTANCE_CAST((object), GST_TYPE_EVENT_SIMULATOR, GstEventSimulator))
#define GST_EVENT_SIMULATOR_CLASS(klass) \
  (G_TYPE_CHECK_CLASS_CAST((klass), GST_TYPE_EVENT_SIMULATOR, GstEventSimulatorClass))
#define GST_EVENT_SIMULATOR_GET_CLASS(object) \
  (G_TYPE_INSTANCE_GET_CLASS((object), GST_TYPE_EVENT_SIMULATOR, GstEventSimulatorClass))

GType gst_event_simulator_get_type(void);

struct GstEventSimulatorPrivate;

struct GstEventSimulator {
  GstBaseTransform parent;
  GstEventSimulatorPrivate* priv;
};

struct GstEventSimulatorClass {
  GstBaseTransformClass parent_class;

  /// Makes the simulator for frames of this format. Called when the format is known; may throw.
  std::unique_ptr<eventcamera::Simulator> (*create)(GstEventSimulator* self,
                                                    const eventcamera::LumaFormat& format);
  /// Tells the simulator, which is one that create() made, the subclass's own settings. Called
  /// before each frame. May be null.
  void (*configure)(GstEventSimulator* self, eventcamera::Simulator& simulator);
};

/// The first property number that a subclass may use for its own.
inline constexpr guint GST_EVENT_SIMULATOR_FIRST_OWN_PROPERTY = 100;

/// For class_init: the properties positive-threshold and negative-threshold, both with this
/// default.
void gst_event_simulator_class_install_thresholds(GstEventSimulatorClass* klass,
                                                  double grey_levels);

/// For class_init: the property interpolated-frames.
void gst_event_simulator_class_install_interpolated_frames(GstEventSimulatorClass* klass);

/// For the set_property and get_property of a subclass that has its own: what it does not know
/// itself.
void gst_event_simulator_set_property(GObject* object, guint id, const GValue* value,
                                      GParamSpec* spec);
void gst_event_simulator_get_property(GObject* object, guint id, GValue* value, GParamSpec* spec);
