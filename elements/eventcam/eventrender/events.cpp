// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/eventrender/events.hpp"

#include <algorithm>
#include <new>
#include <optional>
#include <utility>

#include "elements/eventcam/eventrender/pictures.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/owned.hpp"

namespace eventrender {

using eventcamera::Microseconds;

/// Pictures are made through a silence, but not through one that no interval could have.
constexpr GstClockTime max_silence = GstClockTime{G_MAXUINT32} * GST_USECOND;

/// A live source that has sent nothing for so long is taken to be silent.
constexpr GstClockTime patience = 200 * GST_MSECOND;

static void warn_of_times(GstEventRender* self) {
  GST_WARNING_OBJECT(self, "events without a time");
  if (std::exchange(self->priv->warned_of_times, true)) return;
  GST_ELEMENT_WARNING(self, STREAM, FORMAT, ("A buffer of events has no PTS; it is left out."),
                      (nullptr));
}

/// Draws the events of a buffer up to some time; all of them where none is given. Tells whether
/// these were all. May throw.
static bool take_events(GstEventRender* self, const MappedEvents& mapped,
                        std::optional<GstClockTime> end) {
  auto& priv = *self->priv;
  const auto start = mapped.start();
  const auto rest = mapped.events().subspan(std::min(*priv.taken, mapped.events().size()));
  auto first_after = rest.end();
  if (end)
    first_after = std::ranges::find_if(
        rest, [&, last = static_cast<Microseconds>(*end / 1000)](const eventcamera::Event& event) {
          return eventcamera::time_of(event, start) > last;
        });
  const auto due = rest.first(static_cast<std::size_t>(first_after - rest.begin()));
  *priv.taken += due.size();
  priv.state->renderer.configure(core_settings(settings_of(self)));
  if (priv.state->renderer.add(due, start) > 0)
    priv.broken.warn(self, "some lie beyond the sensor");
  return first_after == rest.end();
}

static void drop_buffer(GstEventRender* self) {
  self->priv->taken.reset();
  gst_aggregator_pad_drop_buffer(sink_pad(self));
}

/// Goes on to the time of a buffer. Tells whether a picture is due before it can be taken.
static bool approach(GstEventRender* self, GstBuffer* buffer, const EventInterval& interval) {
  auto& priv = *self->priv;
  if (!priv.taken) {
    const bool returns =
        GST_BUFFER_IS_DISCONT(buffer) && interval.start + event_resolution < priv.known;
    const bool leaps = priv.times && interval.start > priv.times->events().end + max_silence;
    if (returns || leaps) priv.begin_anew();
    priv.taken = 0;
  }
  const GstSegment segment = segment_of(self);
  if (!priv.times && GST_VIDEO_INFO_FPS_N(&*priv.state->video) > 0 &&
      (interval.end > segment.start || interval.start >= segment.start))
    priv.times.emplace(std::max(interval.start, segment.start), *priv.state->video);
  return priv.times && interval.start >= priv.times->events().end;
}

/// Takes what is due of a buffer, and sends the picture on that this completes. May throw.
static GstFlowReturn take_buffer(GstEventRender* self, GstBuffer* buffer) {
  auto& priv = *self->priv;
  const auto interval = interval_of(buffer);
  if (!interval) {
    warn_of_times(self);
    drop_buffer(self);
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  if (approach(self, buffer, *interval)) return push_next_picture(self);
  std::optional<GstClockTime> due;
  if (priv.times) due = priv.times->events().end;
  bool all = false;
  {
    const MappedEvents mapped(buffer);
    if (!mapped) {
      priv.broken.warn(self, "a buffer is no whole number of events");
      drop_buffer(self);
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    }
    all = take_events(self, mapped, due);
  }
  priv.known = std::max(priv.known, interval->end);
  if (due && (!all || interval->end + event_resolution > *due)) return push_next_picture(self);
  drop_buffer(self);
  if (GST_VIDEO_INFO_FPS_N(&*priv.state->video) > 0 || interval->end <= segment_of(self).start)
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  return push_picture(self, *interval, *interval);
}

/// A live source is silent: the first picture begins now.
static void begin_now(GstEventRender* self) {
  const GstSegment segment = segment_of(self);
  const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(self));
  const guint64 position = gst_segment_position_from_running_time(&segment, GST_FORMAT_TIME, now);
  if (GST_CLOCK_TIME_IS_VALID(position) && GST_VIDEO_INFO_FPS_N(&*self->priv->state->video) > 0)
    self->priv->times.emplace(position, *self->priv->state->video);
}

/// May throw.
static GstFlowReturn take_next(GstEventRender* self, bool timed_out) {
  auto& priv = *self->priv;
  GstAggregatorPad* pad = sink_pad(self);
  if (timed_out) priv.waiting_since.reset();  // where nothing can begin yet, wait as long again
  if (!priv.state || !priv.state->video) {
    if (gst_aggregator_pad_is_eos(pad)) return GST_FLOW_EOS;
    return gst_aggregator_pad_has_buffer(pad) ? GST_FLOW_NOT_NEGOTIATED
                                              : GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  if (const OwnedBuffer buffer{gst_aggregator_pad_peek_buffer(pad)})
    return take_buffer(self, buffer.get());
  if (gst_aggregator_pad_is_eos(pad))
    return has_begun_picture(self) ? push_next_picture(self) : GST_FLOW_EOS;
  if (!timed_out) return GST_AGGREGATOR_FLOW_NEED_DATA;
  if (priv.times) return push_next_picture(self);
  begin_now(self);
  return GST_AGGREGATOR_FLOW_NEED_DATA;
}

GstFlowReturn aggregate(GstAggregator* aggregator, gboolean timed_out) {
  auto* self = event_render(aggregator);
  try {
    return take_next(self, timed_out != FALSE);
  } catch (const std::bad_alloc&) {
    report_no_memory(self);
    return GST_FLOW_ERROR;
  }
}

GstClockTime get_next_time(GstAggregator* aggregator) {
  auto* self = event_render(aggregator);
  auto& priv = *self->priv;
  if (!priv.state) return GST_CLOCK_TIME_NONE;
  if (!priv.times) {
    const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(self));
    if (!priv.waiting_since && GST_CLOCK_TIME_IS_VALID(now)) priv.waiting_since = now;
    return priv.waiting_since ? *priv.waiting_since + patience : GST_CLOCK_TIME_NONE;
  }
  const GstSegment segment = segment_of(self);
  return gst_segment_to_running_time(&segment, GST_FORMAT_TIME, priv.times->picture().start);
}

}  // namespace eventrender
