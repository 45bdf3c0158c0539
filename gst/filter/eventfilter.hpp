// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbasetransform.h>

#include <concepts>
#include <memory>
#include <optional>
#include <utility>

#include "gst/base/guarded.hpp"
#include "src/core/sensor_size.hpp"
#include "src/filter/filter.hpp"

/// Implementation of an element that filters events in place. Each subclass of GstEventFilter owns
/// one, which lives as long as the element.
///
/// Called under the stream lock of the sink pad, or in a state change after streaming has stopped.
class EventFilter {
 public:
  virtual ~EventFilter() = default;

  /// Starts a stream of a sensor of size `in`. All kept events must fit into `out`, the size in the
  /// output caps, which differs from `in` only if the subclass overrides transform_caps.
  virtual void start(eventcamera::SensorSize in, eventcamera::SensorSize out) = 0;
  virtual void stop() {}
  /// Like the member function of eventcamera::Filter. May change x and y, too.
  virtual eventcamera::LabelledEvents filter(eventcamera::LabelledEvents events,
                                             eventcamera::Microseconds start) = 0;
  /// Forgets the past, because of a flush or because time starts over.
  virtual void forget() {}
};

/// Settings of an element, derived from the settings of an eventcamera::Filter, and the filter,
/// made from the sensor's size or from the sizes of input and output.
template <eventcamera::Filter Core,
          std::derived_from<typename Core::Settings> SettingsType = typename Core::Settings>
class EventFilterOf : public EventFilter {
 public:
  using Settings = SettingsType;

  void start(eventcamera::SensorSize in, eventcamera::SensorSize out) override {
    core_.reset();  // first, for its memory
    if constexpr (std::constructible_from<Core, eventcamera::SensorSize, eventcamera::SensorSize>)
      core_.emplace(in, out);
    else
      core_.emplace(in);
  }
  void stop() override { core_.reset(); }
  eventcamera::LabelledEvents filter(eventcamera::LabelledEvents events,
                                     eventcamera::Microseconds start) override {
    return core_->filter(events, start, settings.copy());
  }
  void forget() override {
    if constexpr (requires(Core core) { core.forget(); })
      if (core_) core_->forget();
  }

  Guarded<Settings> settings;

 protected:
  std::optional<Core> core_;
};

/// Abstract base class of elements that filter events: a wrapper around an EventFilter.
///
/// Events outside the sensor, and those out of order, are dropped before. An interval without
/// events left is a GAP. Filters forget the past after a flush and where time goes back. They keep
/// it through gaps, new segments and DISCONT: state is timestamped, so it expires by itself.
#define GST_TYPE_EVENT_FILTER (gst_event_filter_get_type())
G_DECLARE_DERIVABLE_TYPE(GstEventFilter, gst_event_filter, GST, EVENT_FILTER, GstBaseTransform)

struct _GstEventFilterClass {
  GstBaseTransformClass parent_class;
};

std::unique_ptr<EventFilter>& gst_event_filter_impl(gpointer element);

template <class Impl>
Impl& filter_impl(gpointer element) {
  return static_cast<Impl&>(*gst_event_filter_impl(element));
}

/// Defines and registers the type of an element with an EventFilter of class `Impl`, which must
/// have a member `settings`, which type_settings() returns; `...` is code for the type, such as
/// implement(). The type's class_init must follow.
#define DEFINE_EVENT_FILTER(Type, type, OBJECT, Impl, element, ...)                \
  G_DECLARE_FINAL_TYPE(Type, type, GST, OBJECT, GstEventFilter)                    \
  struct _##Type {                                                                 \
    GstEventFilter parent;                                                         \
  };                                                                               \
  G_DEFINE_TYPE_WITH_CODE(Type, type, GST_TYPE_EVENT_FILTER, __VA_ARGS__)          \
  GST_ELEMENT_REGISTER_DEFINE(element, #element, GST_RANK_NONE, type##_get_type()) \
  /* A type takes no parentheses: NOLINTNEXTLINE(bugprone-macro-parentheses) */    \
  static void type##_init(Type* self) {                                            \
    gst_event_filter_impl(self) = std::make_unique<Impl>();                        \
  }                                                                                \
  static auto& type##_settings(GObject* object) {                                  \
    return filter_impl<Impl>(object).settings;                                     \
  }
