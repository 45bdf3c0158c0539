// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>
#include <gst/video/video.h>

#include "src/core/event_buckets.hpp"
#include "src/core/thread_pool.hpp"
#include "src/render/accumulator.hpp"

/// For class_init: the functions of GstBaseTransform about buffers, in and out.
void event_simulator_class_install_buffers(GstBaseTransformClass* klass);

/// Accumulated-event video.
struct Drawing {
  GstVideoInfo video;
  eventcamera::Accumulator accumulator;
};

/// Makes a buffer of an interval's events, at least one. `in` is the frame that ends the interval.
/// Throws std::bad_alloc.
GstFlowReturn event_simulator_write_events(GstBaseTransform* transform,
                                           const eventcamera::EventBuckets& events,
                                           eventcamera::ThreadPool& threads, GstBuffer* in,
                                           GstBuffer** out);

/// Makes a picture of an interval's events.
GstFlowReturn event_simulator_draw_events(GstBaseTransform* transform,
                                          const eventcamera::EventBuckets& events, Drawing& drawing,
                                          const eventcamera::Palette& palette,
                                          eventcamera::ThreadPool& threads, GstBuffer* in,
                                          GstBuffer** out);
