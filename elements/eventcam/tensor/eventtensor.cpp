// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventtensor
 * @title: eventtensor
 * @short_description: turns windows of events into tensors
 *
 * Cuts an event stream into windows and outputs a tensor of each, for networks:
 * `other/tensors, format=static, num_tensors=1`, as NNStreamer defines them. The dimensions, the
 * innermost first, are width:height:channels:1, so a buffer is an array
 * [1][channels][height][width] in C. With GStreamer 1.26 or newer, a GstTensorMeta named
 * `event-tensor` describes the same.
 *
 * A window is as long as #GstEventTensor:event-count events if that is not 0, else as
 * #GstEventTensor:accumulation-time if that is not 0, else as #GstEventTensor:frame-count buffers
 * of the source, such as the intervals between frames. The next window repeats the share
 * #GstEventTensor:overlap of it.
 *
 * - Windows by time follow each other without gaps, events or not; the first begins with the first
 *   buffer, or at the start of the segment. They hold the events with start ≤ t < end.
 * - Windows by count last from their first to their last event, in microseconds.
 * - Windows of buffers last from the start of the first to the end of the last; a GAP is a buffer
 *   without events.
 *
 * There are no tensors of pauses of more than a minute or 10000 windows, with one warning.
 *
 * A tensor has the PTS and duration of its window. At EOS the remaining events make a last,
 * shorter window, which ends with the stream.
 *
 * - `voxel-grid`: each event adds its polarity, +1 or -1, to the two nearest of
 *   #GstEventTensor:bins instants, in proportion to their closeness. The first instant is the time
 *   of the first event of the window, the last instant the time of the last event (Zhu et al., CVPR
 *   2019; E2VID).
 * - `histogram`: the number of OFF (channel 0) and of ON events (channel 1) of each pixel.
 * - `time-surface`: a value that decays with the age of the last OFF (channel 0) and the last ON
 *   event (channel 1) at the end of the window, from 1; 0 where there was none (Lagorce et al.,
 *   TPAMI 2017). Events of earlier windows count, too.
 * - `event-frame`: ON minus OFF events.
 *
 * #GstEventTensor:normalization follows. In tensors of #GstEventTensor:data-type `uint8`, a value
 * v is, rounded and clamped:
 *
 * |                             | `none`  | `mean-std`   | `max`         |
 * |-----------------------------|---------|--------------|---------------|
 * | `voxel-grid`, `event-frame` | 128 + v | 128 + 32 × v | 128 + 127 × v |
 * | `histogram`                 | v       | 128 + 32 × v | 255 × v       |
 * | `time-surface`              | 255 × v | 128 + 32 × v | 255 × v       |
 *
 * A tensor and its intermediate values take at most 1 GiB. Windows have at most
 * 16777216 events; further ones are skipped.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventtensor
 * representation=voxel-grid accumulation-time=50000000 ! filesink location=voxels.f32
 * ]|
 *
 * Since: 0.1
 */
#include "features.hpp"
#include "gst/base/buffer_bytes.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/event_pool.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/properties.hpp"
#include "src/tensor/event_tensor.hpp"
#include "src/tensor/window_queue.hpp"
#ifdef HAVE_TENSOR_META
#include <gst/analytics/analytics.h>

#endif

GST_DEBUG_CATEGORY_STATIC(event_tensor_debug);
#define GST_CAT_DEFAULT event_tensor_debug

using namespace eventcamera;

namespace {

/// Maximum gap between buffers that windows by time continue through; no interval is longer.
constexpr GstClockTime max_tensor_gap = GstClockTime{G_MAXUINT32} * GST_USECOND;

/// Times beyond this are not used: the ends of windows would not fit into 64 bits.
constexpr GstClockTime max_tensor_time = GstClockTime{1} << 62;

struct TensorProperties {
  Representation representation = Representation::voxel_grid;
  guint bins = 5;
  Decay decay = Decay::exponential;
  GstClockTime time_constant = 50 * GST_MSECOND;
  Normalization normalization = Normalization::none;
  ElementType type = ElementType::float32;
  guint event_count = 0;
  GstClockTime accumulation_time = 0;
  guint frame_count = 1;
  gdouble overlap = 0;

  TensorSettings of_tensors() const {
    return {
        .representation = representation,
        .bins = static_cast<int>(bins),
        .decay = decay,
        .time_constant = static_cast<Microseconds>(std::max(time_constant / 1000, GstClockTime{1})),
        .normalization = normalization,
        .type = type};
  }

  WindowSettings of_windows() const {
    const auto duration = accumulation_time > 0 ? std::max(accumulation_time, event_resolution) : 0;
    return {.events = event_count,
            .duration = static_cast<Nanoseconds>(duration),
            .intervals = frame_count,
            .overlap = overlap};
  }
};

GType tensor_data_type() {
  return enum_type<ElementType>("GstEventTensorDataType",
                                {{ElementType::float32, "32-bit floating point", "float32"},
                                 {ElementType::float16, "16-bit floating point", "float16"},
                                 {ElementType::uint8, "Unsigned bytes", "uint8"}});
}

struct TensorFormat {
  TensorFormat(const GstEventCameraInfo& input, const TensorProperties& properties)
      : sensor(input), tensors(properties.of_tensors()), windows(properties.of_windows()) {}

  TensorShape shape() const { return {sensor.width, sensor.height, tensors}; }
  OwnedCaps caps() const {
    const auto of = shape();
    const auto dimensions = std::to_string(of.width) + ":" + std::to_string(of.height) + ":" +
                            std::to_string(of.channels) + ":1";
    const auto [fps_n, fps_d] = framerate();
    const auto* const type =
        g_enum_get_value(static_cast<GEnumClass*>(g_type_class_peek(tensor_data_type())),
                         static_cast<gint>(tensors.type));
    return OwnedCaps(gst_caps_new_simple(
        "other/tensors", "format", G_TYPE_STRING, "static", "num_tensors", G_TYPE_INT, 1,
        "dimensions", G_TYPE_STRING, dimensions.c_str(), "types", G_TYPE_STRING, type->value_nick,
        "framerate", GST_TYPE_FRACTION, fps_n, fps_d, nullptr));
  }

  /// Time from the start of a window to its end, as far as it is known.
  GstClockTime latency() const {
    if (windows.events > 0) return 0;
    if (windows.duration > 0) return static_cast<GstClockTime>(windows.duration);
    if (sensor.fps_n <= 0) return 0;
    return gst_util_uint64_scale((windows.intervals - 1) * GST_SECOND,
                                 static_cast<guint64>(sensor.fps_d),
                                 static_cast<guint64>(sensor.fps_n));
  }

  GstEventCameraInfo sensor;
  TensorSettings tensors;
  WindowSettings windows;

 private:
  /// Framerate of the tensors: 0/1 if it varies or is not a fraction of integers.
  std::pair<gint, gint> framerate() const {
    gint n = 0;
    gint d = 1;
    if (windows.events > 0) return {n, d};
    const auto hop = windows.duration > 0
                         ? windows.hop(windows.duration)
                         : static_cast<Nanoseconds>(windows.hop(windows.intervals));
    if (hop > G_MAXINT) return {n, d};
    const gboolean fits = windows.duration > 0
                              ? gst_util_fraction_multiply(static_cast<gint>(GST_SECOND), 1, 1,
                                                           static_cast<gint>(hop), &n, &d)
                              : gst_util_fraction_multiply(sensor.fps_n, sensor.fps_d, 1,
                                                           static_cast<gint>(hop), &n, &d);
    return fits ? std::pair(n, d) : std::pair(0, 1);
  }
};

/// Caps fields, and the properties that determine them.
constexpr std::pair<const char*, const char*> advice[] = {
    {"types", "set data-type"},
    {"dimensions", "set representation or bins, or scale the events"},
    {"framerate", "set accumulation-time, frame-count or overlap"}};

/// Text: the fields in which `wanted` differs from fixed caps, and the properties to set.
std::string mismatch_text(GstCaps* wanted, GstCaps* made) {
  std::string wishes;
  if (gst_caps_get_size(wanted) == 0) return wishes;
  for (const auto& [field, remedy] : advice) {
    const auto* value = gst_structure_get_value(gst_caps_get_structure(wanted, 0), field);
    if (value == nullptr ||
        gst_value_intersect(nullptr, value,
                            gst_structure_get_value(gst_caps_get_structure(made, 0), field)))
      continue;
    gchar* const text = gst_value_serialize(value);
    wishes +=
        (wishes.empty() ? ": " : ", ") + (std::string(field) + "=") + text + " (" + remedy + ")";
    g_free(text);
  }
  return wishes;
}

#ifdef HAVE_TENSOR_META

GstTensorDataType data_type_of(ElementType type) {
  switch (type) {
    case ElementType::float32:
      return GST_TENSOR_DATA_TYPE_FLOAT32;
    case ElementType::float16:
      return GST_TENSOR_DATA_TYPE_FLOAT16;
    case ElementType::uint8:
      break;
  }
  return GST_TENSOR_DATA_TYPE_UINT8;
}

/// Returns a buffer of the same memory, because a meta that refers to its own buffer is never
/// freed.
GstBuffer* same_memory(GstBuffer* buffer) {
  GstBuffer* const same = gst_buffer_new();
  for (guint i = 0; i < gst_buffer_n_memory(buffer); ++i)
    gst_buffer_append_memory(same, gst_buffer_get_memory(buffer, i));
  return same;
}

/// Describes the bytes of a buffer in a GstTensorMeta, with its dimensions in C order: 1, channels,
/// rows, columns.
void add_tensor_meta(GstBuffer* buffer, const TensorShape& shape, const TensorSettings& settings) {
  static const GQuark id = g_quark_from_static_string("event-tensor");
  std::array<gsize, 4> dimensions = {1, static_cast<gsize>(shape.channels),
                                     static_cast<gsize>(shape.height),
                                     static_cast<gsize>(shape.width)};
  auto** const tensors = g_new(GstTensor*, 1);
  tensors[0] =
      gst_tensor_new_simple(id, data_type_of(settings.type), same_memory(buffer),
                            GST_TENSOR_DIM_ORDER_ROW_MAJOR, dimensions.size(), dimensions.data());
  gst_tensor_meta_set(gst_buffer_add_tensor_meta(buffer), 1, tensors);
}

#else

void add_tensor_meta(GstBuffer*, const TensorShape&, const TensorSettings&) {}

#endif

/// Maximum memory of a tensor and its intermediate values.
constexpr gsize max_tensor_bytes = gsize{1} << 30;

/// State from caps to stop.
struct State {
  explicit State(const TensorFormat& of)
      : format(of),
        tensor(of.sensor.width, of.sensor.height, of.tensors),
        windows(of.sensor.width, of.sensor.height, of.windows) {}

  void start_over() {
    windows.reset();
    tensor.reset();
  }

  TensorFormat format;
  EventTensor tensor;
  WindowQueue windows;
};

/// State from start to stop.
struct Stream {
  Stream() { gst_segment_init(&segment, GST_FORMAT_UNDEFINED); }

  std::optional<State> state;
  EventBuffers buffers;
  GstSegment segment;
  GstFlowReturn gap_result = GST_FLOW_OK;  ///< of the last GAP, for the next buffer
  bool discontinuous = true;               ///< the next tensor is discontinuous
  EventFaults faults{"use", GST_CAT_DEFAULT};
  WarnOnce warn_of_excess{GST_CAT_DEFAULT};
  WarnOnce warn_of_pause{GST_CAT_DEFAULT};
};

struct Private : ElementPads {
  using ElementPads::ElementPads;

  Guarded<TensorProperties> settings;
  Guarded<GstClockTime> latency;
  StreamLocked<Stream> stream{sink};
};

}  // namespace

DEFINE_EVENT_ELEMENT(GstEventTensor, gst_event_tensor, EVENT_TENSOR, GstElement, GST_TYPE_ELEMENT,
                     eventtensor, GST_RANK_NONE, "windows of events as tensors")

static const Report no_memory{
    GST_RESOURCE_ERROR_NO_SPACE_LEFT,
    "Not enough memory for a tensor; lower bins, the resolution or the length of windows."};

/// Longest pause that is filled with empty tensors.
static GstClockTime max_pause_of(const State& state) {
  constexpr GstClockTime max_windows = 10'000;
  const auto duration = static_cast<GstClockTime>(state.format.windows.duration);
  if (duration == 0) return max_tensor_gap;  // each interval is one window at most
  return std::max(duration, std::min(max_pause, max_windows * duration));
}

static GstFlowReturn push_tensor(Private& self, const WindowQueue::Window& window) {
  auto& tensor = self.stream->state->tensor;
  OwnedBuffer buffer = self.stream->buffers.acquire(tensor.bytes());
  GstBuffer* const acquired = buffer.get();
  tensor.write(window.events, window.end / static_cast<Nanoseconds>(GST_USECOND),
               WritableBytes(acquired).get().data());
  const EventInterval interval{static_cast<GstClockTime>(window.start),
                               static_cast<GstClockTime>(window.end)};
  stamp(acquired, interval, self.stream->discontinuous);
  add_tensor_meta(acquired, tensor.shape(), self.stream->state->format.tensors);
  GST_LOG_OBJECT(self.element,
                 "tensor of %" G_GSIZE_FORMAT " events from %" GST_TIME_FORMAT
                 " to %" GST_TIME_FORMAT,
                 window.events.size(), GST_TIME_ARGS(interval.start), GST_TIME_ARGS(interval.end));
  return gst_pad_push(self.src, buffer.release());
}

/// Ends the current windows: pushes the last tensor and forgets all events.
static GstFlowReturn drain(Private& self) {
  if (!self.stream->state) return GST_FLOW_OK;
  const GstFlowReturn result = catch_exceptions(self.element, no_memory, [&] {
    const auto window = self.stream->state->windows.finish();
    return window ? push_tensor(self, *window) : GST_FLOW_OK;
  });
  self.stream->state->start_over();
  self.stream->discontinuous = true;
  return result;
}

/// Ends the current windows if an interval is too far from the last one.
static GstFlowReturn drain_before_jump(Private& self, const EventInterval& interval) {
  const auto last = self.stream->state->windows.reached();
  if (!last) return GST_FLOW_OK;
  const auto reached = static_cast<GstClockTime>(*last);
  const bool returns = interval.start + event_resolution < reached;
  const bool leaps = interval.start > reached + max_pause_of(*self.stream->state);
  if (!returns && !leaps) return GST_FLOW_OK;
  GST_DEBUG_OBJECT(
      self.element, "starting over: time %s from %" GST_TIME_FORMAT " to %" GST_TIME_FORMAT,
      returns ? "goes back" : "leaps", GST_TIME_ARGS(reached), GST_TIME_ARGS(interval.start));
  return drain(self);
}

/// Adds an interval, and pushes the tensors of the windows that it completes.
static GstFlowReturn add(Private& self, std::span<const Event> events, Microseconds base,
                         const EventInterval& interval, GstBuffer* buffer) {
  const GstClockTime start = std::max(interval.start, self.stream->segment.start);
  if (interval.end < start || (interval.end == start && interval.start < start)) return GST_FLOW_OK;
  const GstFlowReturn result = drain_before_jump(self, {start, interval.end});
  if (result != GST_FLOW_OK) return result;
  do {
    const auto added = self.stream->state->windows.add(
        events, base, static_cast<Nanoseconds>(start), static_cast<Nanoseconds>(interval.end));
    self.stream->faults.warn(self.element, added.invalid, buffer);
    if (added.excess > 0)
      self.stream->warn_of_excess(
          self.element,
          {GST_STREAM_ERROR_FAILED, "Cannot use all events: there are more than " +
                                        std::to_string(WindowQueue::max_events) +
                                        " in a window; skipping the rest. Shorten the windows."},
          std::to_string(added.excess) + " events skipped");
    while (const auto window = self.stream->state->windows.next()) {
      const GstFlowReturn pushed = push_tensor(self, *window);
      if (pushed != GST_FLOW_OK) return pushed;
    }
    events = added.waiting;
  } while (!events.empty());
  return GST_FLOW_OK;
}

static GstFlowReturn chain(GstPad*, GstObject* parent, GstBuffer* received) {
  auto& self = priv_of(parent);
  const OwnedBuffer buffer(received);
  if (!self.stream->state) return GST_FLOW_NOT_NEGOTIATED;
  self.stream->discontinuous |= GST_BUFFER_IS_DISCONT(received);
  const auto gap_result = std::exchange(self.stream->gap_result, GST_FLOW_OK);
  if (gap_result != GST_FLOW_OK) return gap_result;
  const MappedEvents mapped(received);
  if (!mapped || mapped.interval().end > max_tensor_time) {
    self.stream->faults.warn(self.element, event_fault(received), received);
    return GST_FLOW_OK;
  }
  GST_LOG_OBJECT(self.sink, "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT,
                 mapped.events().size(), GST_TIME_ARGS(mapped.interval().start));
  return catch_exceptions(self.element, no_memory, [&] {
    return add(self, mapped.events(), mapped.start(), mapped.interval(), received);
  });
}

/// Returns true if the gap is not forwarded, because tensors cover it. The next buffer returns a
/// failure to push them.
static bool handle_gap(Private& self, GstEvent* event) {
  GstClockTime start = 0;
  GstClockTime duration = 0;
  gst_event_parse_gap(event, &start, &duration);
  if (!self.stream->state) return false;
  if (self.stream->state->format.windows.events > 0 || !GST_CLOCK_TIME_IS_VALID(duration) ||
      start > max_tensor_time || duration > max_tensor_time - start)
    return self.stream->state->windows.is_open();
  if (duration > max_pause_of(*self.stream->state)) {
    self.stream->warn_of_pause(
        self.element,
        {GST_STREAM_ERROR_FAILED, "The events pause; skipping the tensors of long pauses."},
        "pause of " + std::to_string(duration / GST_SECOND) + " s");
    // Ends the current window; the next events start over.
    duration = static_cast<GstClockTime>(self.stream->state->format.windows.duration);
  }
  self.stream->gap_result = catch_exceptions(self.element, no_memory, [&] {
    return add(self, {}, 0, {start, start + duration}, nullptr);
  });
  return true;
}

/// Returns true if downstream accepts the caps; otherwise posts an error message.
static bool post_unless_accepted(Private& self, GstCaps* caps) {
  const OwnedCaps wanted(gst_pad_peer_query_caps(self.src, nullptr));
  if (gst_caps_can_intersect(wanted.get(), caps)) return true;
  gchar* const cause = gst_info_strdup_printf(
      "downstream accepts %" GST_PTR_FORMAT ", not %" GST_PTR_FORMAT, wanted.get(), caps);
  post_message(self.element, GST_MESSAGE_ERROR,
               {GST_STREAM_ERROR_FORMAT, "Downstream does not accept these tensors" +
                                             mismatch_text(wanted.get(), caps) + "."},
               cause);
  g_free(cause);
  return false;
}

static bool make_state(Private& self, const GstEventCameraInfo& info) {
  self.stream->state.reset();
  const TensorFormat format(info, self.settings.copy());
  const auto bytes = EventTensor::memory(format.shape(), format.tensors);
  if (bytes > max_tensor_bytes) {
    post_message(self.element, GST_MESSAGE_ERROR,
                 {GST_STREAM_ERROR_FORMAT,
                  "Cannot make tensors that take more than 1 GiB; lower bins or the resolution."},
                 in_pixels({info.width, info.height}) + " and " +
                     std::to_string(format.tensors.bins) + " bins make " + std::to_string(bytes) +
                     " bytes");
    return false;
  }
  self.stream->state.emplace(format);
  return true;
}

static gboolean handle_caps(Private& self, const GstCaps* caps) {
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps)) return FALSE;
  if (self.stream->state && self.stream->state->format.sensor.width == info.width &&
      self.stream->state->format.sensor.height == info.height) {
    self.stream->state->format.sensor = info;
  } else {
    drain(self);
    if (!catch_exceptions(self.element, no_memory, [&] { return make_state(self, info); }))
      return FALSE;
  }
  *self.latency.lock() = self.stream->state->format.latency();
  const OwnedCaps out = self.stream->state->format.caps();
  GST_DEBUG_OBJECT(self.element, "events of %dx%d pixels become %" GST_PTR_FORMAT, info.width,
                   info.height, out.get());
  if (!post_unless_accepted(self, out.get())) return FALSE;
  const gboolean handled = gst_pad_push_event(self.src, gst_event_new_caps(out.get()));
  post_latency(self.element);
  return handled;
}

static gboolean sink_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  auto& self = priv_of(parent);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      const OwnedEvent owned(event);
      return handle_caps(self, caps_of(event));
    }
    case GST_EVENT_GAP:
      if (handle_gap(self, event)) {
        gst_event_unref(event);
        return self.stream->gap_result == GST_FLOW_OK ? TRUE : FALSE;
      }
      break;
    case GST_EVENT_SEGMENT:
      if (!plays_events(self.element, event, "make tensors of")) return FALSE;
      if (!continues(self.stream->segment, segment_of(event))) drain(self);
      self.stream->segment = segment_of(event);
      break;
    case GST_EVENT_SEGMENT_DONE:
    case GST_EVENT_EOS:
      drain(self);
      break;
    case GST_EVENT_FLUSH_STOP:
      gst_segment_init(&self.stream->segment, GST_FORMAT_UNDEFINED);
      self.stream->gap_result = GST_FLOW_OK;
      if (self.stream->state) self.stream->state->start_over();
      self.stream->discontinuous = true;
      break;
    default:
      break;
  }
  return gst_pad_event_default(pad, parent, event);
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  auto& self = priv_of(element);
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_event_tensor_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    self.stream.reset();
    *self.latency.lock() = 0;
  }
  return result;
}

static void gst_event_tensor_init(GstEventTensor* self) {
  self->priv = new Private(GST_ELEMENT(self), chain, sink_event);
  answer_latency_queries<[](gpointer element) { return priv_of(element).latency.copy(); }>(
      self->priv->src);
}

static void gst_event_tensor_class_init(GstEventTensorClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;
  Properties<field_of<&Private::settings>> properties(object_class);
  constexpr guint max_frame_count = 10'000;
  properties.add_fixed(
      &TensorProperties::representation, "representation", "Content of a tensor",
      enum_type<Representation>(
          "GstEventTensorRepresentation",
          {{Representation::voxel_grid,
            "Polarities, shared out to the two nearest of several instants", "voxel-grid"},
           {Representation::histogram, "Numbers of OFF and of ON events", "histogram"},
           {Representation::time_surface, "Decayed age of the last OFF and the last ON event",
            "time-surface"},
           {Representation::event_frame, "ON minus OFF events", "event-frame"}}));
  properties.add_fixed(&TensorProperties::bins, "bins", "Channels of a voxel grid", 1,
                       GST_EVENT_CAMERA_MAX_BINS);
  properties.add_fixed(
      &TensorProperties::decay, "decay", "How the values of a time surface decrease",
      enum_type<Decay>("GstEventTensorDecay",
                       {{Decay::exponential, "exp(-age / time-constant)", "exponential"},
                        {Decay::linear, "1 - age / time-constant, at least 0", "linear"}}));
  properties.add_fixed(&TensorProperties::time_constant, "time-constant",
                       "Time constant of the decay of a time surface (ns)", GST_USECOND,
                       max_tensor_time);
  properties.add_fixed(
      &TensorProperties::normalization, "normalization", "How the values of a tensor are scaled",
      enum_type<Normalization>(
          "GstEventTensorNormalization",
          {{Normalization::none, "As counted", "none"},
           {Normalization::mean_std,
            "Nonzero values get the mean 0 and the standard deviation 1, as for E2VID", "mean-std"},
           {Normalization::max, "The largest magnitude becomes 1", "max"}}));
  properties.add_fixed(&TensorProperties::type, "data-type", "Type of the numbers in a tensor",
                       tensor_data_type());
  properties.add_fixed(&TensorProperties::event_count, "event-count",
                       "Number of events in a window (0 = not limited by count)", 0,
                       static_cast<guint>(WindowQueue::max_events));
  properties.add_fixed(
      &TensorProperties::accumulation_time, "accumulation-time",
      "Length of a window without event-count (ns, at least 1000; 0 = frame-count buffers)", 0,
      max_tensor_gap);
  properties.add_fixed(&TensorProperties::frame_count, "frame-count",
                       "Number of buffers in a window without event-count and accumulation-time, "
                       "such as intervals between frames",
                       1, max_frame_count);
  properties.add_fixed(&TensorProperties::overlap, "overlap",
                       "Share of a window that the next one repeats", 0, 0.99);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = change_state;
  add_pad_templates(element_class, EVENT_CAPS,
                    "other/tensors, format = (string) static, num_tensors = (int) 1, types = "
                    "(string) { float32, float16, uint8 }, framerate = (fraction) [ 0, max ]");
  set_metadata(klass, "Event tensors", "Converter", "Turns windows of events into tensors");
}
