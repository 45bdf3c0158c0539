// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

#include <initializer_list>
#include <memory>
#include <optional>

#include "gst/base/event_buffer.hpp"
#include "gst/base/owned.hpp"

/// What an element does with the event streams, and video, of its sink pads. A subclass of
/// GstEventAggregator brings one, which lives as long as the element.
///
/// One sink pad is the main one: the output has its segment, and the element is as seekable as what
/// comes to it. A seek goes to all pads, or to none where one of them would refuse it.
///
/// Functions are called by the source pad's thread, or while there is none.
class EventAggregator {
 public:
  struct Role {
    const char* verb;               ///< what it does with events, in messages: "draw"
    const char* main_pad = "sink";  ///< a name
    /// Whether the buffers of the main pad go on as they come, with their caps.
    bool passes_main_pad = true;
  };

  EventAggregator(GstAggregator* element, const Role& role);
  virtual ~EventAggregator() = default;
  EventAggregator(const EventAggregator&) = delete;
  EventAggregator& operator=(const EventAggregator&) = delete;

  /// False where the element cannot start; it has reported why.
  virtual bool start() { return true; }
  /// Drops all state.
  virtual void stop() = 0;
  /// Drops the events so far: what comes next does not follow on them. May throw.
  virtual void flush() = 0;
  /// Drops what takes memory, when there is too little.
  virtual void release_memory() { flush(); }

  /// False where these caps are refused. May throw.
  virtual bool take_caps(GstAggregatorPad* pad, GstCaps* caps) = 0;
  /// A segment comes to the main pad, where the last one still is. May throw.
  virtual void take_segment(const GstSegment&) {}
  /// As GstAggregatorClass::aggregate. May throw.
  virtual GstFlowReturn aggregate(bool timed_out) = 0;
  /// When to go on without further input, from live sources.
  virtual GstClockTime next_time() { return GST_CLOCK_TIME_NONE; }

 protected:
  GstAggregator* element() const { return element_; }
  /// A sink pad by its name.
  GstAggregatorPad* pad(const char* name) const;
  GstAggregatorPad* main_pad() const { return main_pad_; }

  /// Warns of events that are skipped.
  void warn(EventFault fault, GstBuffer* buffer) { faults_.warn(element_, fault, buffer); }

 private:
  friend struct EventAggregatorFunctions;

  GstAggregator* element_;
  Role role_;
  GstAggregatorPad* main_pad_;
  OwnedCaps main_caps_;
  EventFaults faults_;
};

/// The segment of a pad: from 0 on where none has come, since live sources send theirs with their
/// first buffer.
GstSegment segment_of(GstAggregatorPad* pad);

/// The running time of a pad's `time`; none outside the segment.
std::optional<GstClockTime> running_time(GstAggregatorPad* pad, GstClockTime time);

/// The abstract base class of elements that take event streams: a shell round an EventAggregator.
#define GST_TYPE_EVENT_AGGREGATOR (gst_event_aggregator_get_type())
G_DECLARE_DERIVABLE_TYPE(GstEventAggregator, gst_event_aggregator, GST, EVENT_AGGREGATOR,
                         GstAggregator)

struct _GstEventAggregatorClass {
  GstAggregatorClass parent_class;
};

/// Adds the sink pads of the templates.
void gst_event_aggregator_add_pads(GstEventAggregator* self);

void gst_event_aggregator_set_inside(GstEventAggregator* self,
                                     std::unique_ptr<EventAggregator> inside);
EventAggregator& gst_event_aggregator_inside(GstEventAggregator* self);

/// For the init function of a subclass: makes its pads, and then what is inside of it.
template <class Inside>
void gst_event_aggregator_make(GstEventAggregator* self) {
  gst_event_aggregator_add_pads(self);
  gst_event_aggregator_set_inside(self, std::make_unique<Inside>(GST_AGGREGATOR(self)));
}

/// What is inside of an element of this kind.
template <class Inside>
Inside& inside_of(gpointer element) {
  return static_cast<Inside&>(gst_event_aggregator_inside(GST_EVENT_AGGREGATOR(element)));
}

/// For class_init: the pad templates, as GstAggregator wants them.
void gst_event_aggregator_class_add_templates(GstEventAggregatorClass* klass,
                                              std::initializer_list<GstStaticPadTemplate*> list);

/// Defines the type of an element with an EventAggregator of class `Inside`, which has `settings`,
/// and registers the element. Its class_init is to follow.
#define DEFINE_EVENT_AGGREGATOR(Type, type, OBJECT, Inside, element, rank, description)       \
  G_DECLARE_FINAL_TYPE(Type, type, GST, OBJECT, GstEventAggregator)                           \
  struct _##Type {                                                                            \
    GstEventAggregator parent;                                                                \
  };                                                                                          \
  G_DEFINE_TYPE_WITH_CODE(Type, type, GST_TYPE_EVENT_AGGREGATOR,                              \
                          GST_DEBUG_CATEGORY_INIT(GST_CAT_DEFAULT, #element, 0, description)) \
  GST_ELEMENT_REGISTER_DEFINE(element, #element, rank, type##_get_type())                     \
  /* A type takes no parentheses: NOLINTNEXTLINE(bugprone-macro-parentheses) */               \
  static void type##_init(Type* self) {                                                       \
    gst_event_aggregator_make<Inside>(GST_EVENT_AGGREGATOR(self));                            \
  }                                                                                           \
  static auto& settings_of(GObject* object) {                                                 \
    return inside_of<Inside>(object).settings;                                                \
  }
