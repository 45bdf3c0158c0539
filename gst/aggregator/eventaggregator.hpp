// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

#include <memory>
#include <optional>
#include <vector>

#include "gst/aggregator/sink_pads.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/seek_request.hpp"

/// Implementation of an element that combines event streams and video. Each subclass of
/// GstEventAggregator owns one, which lives as long as the element.
///
/// One sink pad is the main pad: the output has its segment, tags and custom events, such as
/// triggers, and its seekable range. An element with request pads has no main pad: the output has
/// the custom events of all pads, the subclass sets the segment, the first pad determines the
/// seekable range, and a seek must flush, because the pads reach it at different times. A seek is
/// forwarded to all pads, or to none if one of them would refuse it.
///
/// Functions are called by the source pad's task, or in state changes while it does not run.
class EventAggregator {
 public:
  struct Role {
    const char* verb;  ///< what the element does with events, for messages: "draw"
    /// Name of the main pad; null if pads are requested.
    const char* main_pad = "sink";
    /// Buffers of the main pad pass through, with its caps or those of output_caps().
    bool passes_main_pad = true;
  };

  EventAggregator(GstAggregator* element, const Role& role);
  virtual ~EventAggregator() = default;
  EventAggregator(const EventAggregator&) = delete;
  EventAggregator& operator=(const EventAggregator&) = delete;

  /// False, after reporting why, if the element cannot start.
  virtual bool start() { return true; }
  virtual void stop() = 0;
  /// Drops all pending events, because the next input is discontinuous.
  virtual void flush() = 0;
  /// Frees as much memory as possible, after an allocation failed.
  virtual void release_memory() noexcept { flush(); }

  /// Returns false to reject `caps`.
  virtual bool handle_caps(GstAggregatorPad* pad, GstCaps* caps) = 0;
  /// Caps that the output has if the main pad, whose buffers pass through, has `input`.
  virtual OwnedCaps output_caps(GstCaps* input) { return OwnedCaps(gst_caps_ref(input)); }
  /// Caps of the main pad, whose buffers pass through, for which the output can have `output`.
  virtual OwnedCaps input_caps(OwnedCaps output) const { return output; }
  /// Handles a new segment of the main pad, before the pad stores it.
  virtual void handle_segment(const GstSegment&) {}
  /// Like GstAggregatorClass::aggregate. Returns GST_FLOW_EOS once no more output follows because a
  /// pad has_ended().
  virtual GstFlowReturn aggregate(bool timed_out) = 0;
  /// Like GstAggregatorClass::get_next_time: when to continue without further input from live
  /// sources. By default when the next buffer of the main pad is due: at once if it has no time,
  /// and at the end of the stream.
  virtual GstClockTime next_time();

  /// Prepares for a seek that GstAggregator forwards next. Called from any thread.
  virtual void prepare_seek(const SeekRequest&) {}

 protected:
  GstAggregator* element() const { return element_; }
  GstAggregatorPad* pad(const char* name) const;
  /// The main pad; null if pads are requested.
  GstAggregatorPad* main_pad() const { return main_pad_; }

  /// Sets the segment of the output. GstAggregator sends it with the next buffer.
  void set_segment(const GstSegment& segment);
  /// True once the segment of the output was sent. Without it, a gap has no meaning.
  bool is_segment_sent() const { return segment_sent_; }

  /// Pushes a buffer of the output, or the GAP event that it stands for.
  GstFlowReturn push(OwnedBuffer buffer);
  /// Pushes a GAP event; before the segment, an empty buffer of events, or no video.
  GstFlowReturn push_gap(GstClockTime start, GstClockTime duration);

  template <class Fault>
  void warn(const Fault& fault, GstBuffer* buffer) {
    faults_.warn(element_, fault, buffer);
  }

 private:
  friend struct EventAggregatorFunctions;

  GstAggregator* element_;
  Role role_;
  GstAggregatorPad* main_pad_;
  OwnedCaps main_caps_;
  std::vector<OwnedEvent> waiting_;  ///< to be sent after the segment
  bool segment_sent_ = false;        ///< of the output
  bool segment_ended_ = false;       ///< of the output; inputs may not have ended yet
  EventFaults faults_;
};

/// Segment of a pad; a segment from 0 if none was received, as live sources send it with the first
/// buffer.
GstSegment segment_of(GstAggregatorPad* pad);

/// Running time of `time` on a pad; none outside its segment.
std::optional<GstClockTime> running_time(GstAggregatorPad* pad, GstClockTime time);

/// True for the buffer that GstAggregator queues for a GAP event.
inline bool is_gap(GstBuffer* buffer) {
  return GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_GAP) && gst_buffer_get_size(buffer) == 0;
}

/// Abstract base class of elements that combine event streams: a wrapper around an EventAggregator.
#define GST_TYPE_EVENT_AGGREGATOR (gst_event_aggregator_get_type())
G_DECLARE_DERIVABLE_TYPE(GstEventAggregator, gst_event_aggregator, GST, EVENT_AGGREGATOR,
                         GstAggregator)

struct _GstEventAggregatorClass {
  GstAggregatorClass parent_class;
};

/// Adds a sink pad per template of an always pad.
void gst_event_aggregator_add_pads(GstEventAggregator* self);

std::unique_ptr<EventAggregator>& gst_event_aggregator_impl(gpointer element);

/// For the init function of a subclass: creates its pads, then its EventAggregator.
template <class Impl>
void gst_event_aggregator_make(GstEventAggregator* self) {
  gst_event_aggregator_add_pads(self);
  gst_event_aggregator_impl(self) = std::make_unique<Impl>(GST_AGGREGATOR(self));
}

template <class Impl>
Impl& aggregator_impl(gpointer element) {
  return static_cast<Impl&>(*gst_event_aggregator_impl(element));
}

/// The member `settings` of an element's EventAggregator, for Properties.
template <class Impl>
auto& aggregator_settings(GObject* object) {
  return aggregator_impl<Impl>(object).settings;
}

/// For class_init: adds the template of an always pad.
inline void add_aggregator_pad_template(GstEventAggregatorClass* klass, const char* name,
                                        GstPadDirection direction, const char* caps) {
  add_pad_template(GST_ELEMENT_CLASS(klass), name, direction, caps, GST_PAD_ALWAYS,
                   GST_TYPE_AGGREGATOR_PAD);
}

/// Defines and registers the type of an element with an EventAggregator of class `Impl`; `...` is
/// code for the type, such as implement(). The type's class_init must follow.
#define DEFINE_EVENT_AGGREGATOR(Type, type, OBJECT, Impl, element, rank, description, ...)    \
  G_DECLARE_FINAL_TYPE(Type, type, GST, OBJECT, GstEventAggregator)                           \
  struct _##Type {                                                                            \
    GstEventAggregator parent;                                                                \
  };                                                                                          \
  G_DEFINE_TYPE_WITH_CODE(Type, type, GST_TYPE_EVENT_AGGREGATOR,                              \
                          GST_DEBUG_CATEGORY_INIT(GST_CAT_DEFAULT, #element, 0, description); \
                          __VA_ARGS__)                                                        \
  GST_ELEMENT_REGISTER_DEFINE(element, #element, rank, type##_get_type())                     \
  /* A type takes no parentheses: NOLINTNEXTLINE(bugprone-macro-parentheses) */               \
  static void type##_init(Type* self) {                                                       \
    gst_event_aggregator_make<Impl>(GST_EVENT_AGGREGATOR(self));                              \
  }
