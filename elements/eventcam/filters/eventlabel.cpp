// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventlabel
 * @title: eventlabel
 * @short_description: labels events with the class of the object that they show
 *
 * Labels each event of the pad `event_sink` with a class: the value of its pixel in the latest
 * image on the pad `video_sink` that is not later than the event. The images have the size of the
 * sensor, and 8 or 16 bits per pixel; the value 0 is the class "unknown", like the class of events
 * before the first image. The two streams are synchronized by running time.
 *
 * Labels that events already carry keep their cause, such as those that `eventsim-dvs label=true`
 * writes; the cause of other events is unknown. Writers that keep labels, such as `eventnpzenc`,
 * `eventhdf5sink` and `eventcsvenc format=labels`, store the classes.
 *
 * Events from a live source wait for images no longer than the latency. Other events wait for the
 * next image, or for a GAP event or EOS.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 eventlabel name=label ! eventnpzenc ! filesink location=classes.npz  videotestsrc
 * pattern=ball num-buffers=100 ! eventsim-dvs label=true ! label.event_sink  videotestsrc
 * pattern=ball num-buffers=100 ! video/x-raw,format=GRAY8 ! label.video_sink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/video/video.h>

#include <limits>

#include "gst/aggregator/eventaggregator.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/video_frame.hpp"

GST_DEBUG_CATEGORY_STATIC(event_label_debug);
#define GST_CAT_DEFAULT event_label_debug

using namespace eventcamera;

namespace {

/// Times closer than this are equal, since streams round them differently.
constexpr auto resolution = Nanoseconds{event_resolution};

constexpr auto never = std::numeric_limits<Nanoseconds>::min() / 2;

/// Running time, negative before the start of the segment; none for invalid times, and times of
/// more than 146 years.
std::optional<Nanoseconds> signed_running_time(GstAggregatorPad* pad, GstClockTime time) {
  const GstSegment segment = segment_of(pad);
  guint64 running = 0;
  const gint sign = gst_segment_to_running_time_full(&segment, GST_FORMAT_TIME, time, &running);
  if (sign == 0 || running >= G_MAXINT64 / 2) return std::nullopt;
  return sign * static_cast<Nanoseconds>(running);
}

std::string size_text(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

class EventLabeller final : public EventAggregator {
 public:
  explicit EventLabeller(GstAggregator* element)
      : EventAggregator(element, {.verb = "label", .main_pad = "event_sink"}) {}

  void stop() override {
    flush();
    sensor_.reset();
    format_.reset();
    warn_of_missing_.reset();
    warn_of_times_.reset();
  }

  void flush() noexcept override {
    head_.reset();
    image_.reset();
    image_time_ = never;
  }

  bool handle_caps(GstAggregatorPad* pad, GstCaps* caps) override {
    if (pad == main_pad()) {
      const auto sensor = sensor_of(caps);
      if (!sensor) return false;
      sensor_ = sensor;
      if (!gst_pad_is_linked(GST_PAD(images_pad_)))
        warn_of_missing_(
            element(),
            {GST_CORE_ERROR_PAD,
             "No class images: link a source of images to the pad \"video_sink\". Until then, "
             "events from a live source get no class, and other events wait."},
            "the pad \"video_sink\" is not linked");
      return true;
    }
    GstVideoInfo format;
    if (!gst_video_info_from_caps(&format, caps)) return false;
    format_ = format;
    const GstClockTime latency = frame_duration(format);
    GST_DEBUG_OBJECT(element(), "latency %" GST_TIME_FORMAT ", one image", GST_TIME_ARGS(latency));
    gst_aggregator_set_latency(element(), latency, latency);
    return true;
  }

  GstFlowReturn aggregate(bool timed_out) override {
    auto buffer = next_buffer(main_pad());
    if (!buffer) return has_ended(main_pad()) ? GST_FLOW_EOS : GST_AGGREGATOR_FLOW_NEED_DATA;
    if (!sensor_ && !is_gap(buffer.get())) return GST_FLOW_NOT_NEGOTIATED;
    if (!head_ || head_->buffer != buffer) head_ = head_of(buffer.get());
    buffer.reset();
    if (!head_) {
      gst_aggregator_pad_drop_buffer(main_pad());
      return GST_FLOW_OK;
    }
    const GstFlowReturn result = read_images();
    const bool is_known = result == GST_FLOW_OK;
    return is_known || (result == GST_AGGREGATOR_FLOW_NEED_DATA && timed_out) ? push_head()
                                                                              : result;
  }

 private:
  struct ClassImage {
    OwnedBuffer buffer;
    GstVideoInfo format;
  };

  /// The first queued buffer of events, whose classes become known image by image.
  struct Head {
    OwnedBuffer buffer;
    EventInterval interval;
    Nanoseconds running_start;
    std::vector<Label> labels;
    std::size_t labelled = 0;  ///< number of events whose class is known
  };

  /// Starts to label a buffer. None, after a warning, if its events have no times.
  std::optional<Head> head_of(GstBuffer* buffer) {
    const auto interval = interval_of(buffer);
    const auto start =
        interval ? signed_running_time(main_pad(), interval->start) : std::optional<Nanoseconds>();
    const gsize size = gst_buffer_get_size(buffer);
    if (!start || size % sizeof(Event) != 0) {
      warn(event_fault(buffer), buffer);
      return std::nullopt;
    }
    const auto present = labels_of(buffer);
    std::vector<Label> labels(present.begin(), present.end());
    labels.resize(size / sizeof(Event));
    return Head{OwnedBuffer(gst_buffer_ref(buffer)), *interval, *start, std::move(labels)};
  }

  /// Time of the head's events at a running time.
  Microseconds microsecond_of(Nanoseconds running_time) const {
    const auto delay =
        static_cast<double>(running_time - head_->running_start) * segment_of(main_pad()).rate;
    const auto since_microsecond = static_cast<Nanoseconds>(head_->interval.start % GST_USECOND);
    return (since_microsecond + static_cast<Nanoseconds>(delay)) / resolution;
  }

  /// Reads the images up to the end of the head. More data is needed if some may still arrive.
  GstFlowReturn read_images() {
    const auto length = static_cast<double>(head_->interval.end - head_->interval.start) /
                        segment_of(main_pad()).rate;
    constexpr auto max = static_cast<double>(G_MAXINT64 / 4);
    const auto end =
        head_->running_start + static_cast<Nanoseconds>(std::min(length, max)) + resolution;
    while (image_time_ + resolution < end) {
      const auto next = next_buffer(images_pad_);
      if (!next) return has_ended(images_pad_) ? GST_FLOW_OK : GST_AGGREGATOR_FLOW_NEED_DATA;
      GstFlowReturn result = GST_FLOW_OK;
      if (is_gap(next.get())) {
        // One that lasts longer stays queued, as GstAggregator waits for a buffer of each pad.
        if (end_of_gap(next.get()).value_or(never) >= end) return GST_FLOW_OK;
      } else {
        const auto time = signed_running_time(images_pad_, GST_BUFFER_PTS(next.get()));
        if (time && *time >= end) return GST_FLOW_OK;
        result = read_image(next.get());
      }
      gst_aggregator_pad_drop_buffer(images_pad_);
      if (result != GST_FLOW_OK) return result;
    }
    return GST_FLOW_OK;
  }

  /// Makes a queued image the current one.
  GstFlowReturn read_image(GstBuffer* buffer) {
    const auto time = signed_running_time(images_pad_, GST_BUFFER_PTS(buffer));
    if (!time || *time < image_time_) {
      warn_of_times_(
          element(),
          {GST_STREAM_ERROR_FORMAT,
           "Cannot match all class images to events: one has no PTS, or an earlier one than the "
           "previous image; skipping it. Set the PTS of the frames that they belong to."},
          "buffer of video_sink");
      return GST_FLOW_OK;
    }
    if (!format_) return GST_FLOW_NOT_NEGOTIATED;
    const GstFlowReturn result = label_until(microsecond_of(*time));
    image_ = ClassImage{OwnedBuffer(gst_buffer_ref(buffer)), *format_};
    image_time_ = *time;
    return result;
  }

  /// Running time at which a queued gap ends, if that is known.
  std::optional<Nanoseconds> end_of_gap(GstBuffer* gap) const {
    const GstClockTime duration = GST_BUFFER_DURATION(gap);
    return signed_running_time(
        images_pad_, GST_BUFFER_PTS(gap) + (GST_CLOCK_TIME_IS_VALID(duration) ? duration : 0));
  }

  /// Sets the classes of the head's events before microsecond `t` from the current image.
  GstFlowReturn label_until(Microseconds t) {
    const MappedEvents mapped(head_->buffer.get());
    if (!mapped) return GST_FLOW_OK;
    const auto is_before = [](const Event& event, Microseconds time) { return event.t < time; };
    const auto rest = mapped.events().subspan(head_->labelled);
    const auto end = std::lower_bound(rest.begin(), rest.end(), t, is_before);
    const auto due = rest.first(static_cast<std::size_t>(end - rest.begin()));
    const auto labels = std::span(head_->labels).subspan(head_->labelled, due.size());
    head_->labelled += due.size();
    if (!image_ || due.empty()) return GST_FLOW_OK;

    const GstVideoInfo& format = image_->format;
    if (GST_VIDEO_INFO_WIDTH(&format) != sensor_->width ||
        GST_VIDEO_INFO_HEIGHT(&format) != sensor_->height) {
      post_message(element(), GST_MESSAGE_ERROR,
                   {GST_CORE_ERROR_NEGOTIATION,
                    "The class images have " +
                        size_text(GST_VIDEO_INFO_WIDTH(&format), GST_VIDEO_INFO_HEIGHT(&format)) +
                        " pixels, and the sensor " + size_text(sensor_->width, sensor_->height) +
                        ". Scale the images with videoscale method=nearest-neighbour."},
                   "caps of event_sink and video_sink");
      return GST_FLOW_ERROR;
    }
    const VideoFrame image(format, image_->buffer.get(), GST_MAP_READ);
    if (!image) {
      post_message(element(), GST_MESSAGE_ERROR,
                   {GST_RESOURCE_ERROR_FAILED, "Cannot read a class image: " + image.fault() +
                                                   ". Check the element upstream."},
                   image.fault());
      return GST_FLOW_ERROR;
    }
    if (GST_VIDEO_INFO_FORMAT(&format) == GST_VIDEO_FORMAT_GRAY8)
      set_classes<guint8>(due, labels, image);
    else
      set_classes<guint16>(due, labels, image);
    return GST_FLOW_OK;
  }

  template <class Pixel>
  void set_classes(std::span<const Event> events, std::span<Label> labels,
                   const VideoFrame& image) {
    bool all_inside = true;
    for (std::size_t i = 0; i < events.size(); ++i) {
      if (events[i].x >= sensor_->width || events[i].y() >= sensor_->height) {
        all_inside = false;
        continue;
      }
      const std::byte* row = image.data() + events[i].y() * image.stride();
      labels[i].object_class = reinterpret_cast<const Pixel*>(row)[events[i].x];
    }
    if (!all_inside) warn(EventFault::beyond_sensor, head_->buffer.get());
  }

  /// Pushes the head with the classes that are known.
  GstFlowReturn push_head() {
    const GstFlowReturn result = label_until(std::numeric_limits<Microseconds>::max());
    if (result != GST_FLOW_OK) return result;
    const auto labels = std::move(head_->labels);
    head_.reset();  // otherwise the buffer would not be writable in place
    OwnedBuffer out(gst_buffer_make_writable(gst_aggregator_pad_pop_buffer(main_pad())));
    auto target = labels_of(out.get());
    if (target.size() != labels.size()) {
      if (auto* invalid = gst_buffer_get_meta(out.get(), GST_EVENT_CAMERA_LABEL_META_API_TYPE))
        gst_buffer_remove_meta(out.get(), invalid);
      target = add_labels(out.get(), labels.size());
    }
    std::ranges::copy(labels, target.begin());
    GST_LOG_OBJECT(main_pad(), "%" G_GSIZE_FORMAT " events labelled at %" GST_TIME_FORMAT,
                   labels.size(), GST_TIME_ARGS(GST_BUFFER_PTS(out.get())));
    return push(std::move(out));
  }

  GstAggregatorPad* const images_pad_ = pad("video_sink");

  std::optional<SensorSize> sensor_;
  std::optional<GstVideoInfo> format_;  ///< of the next image
  std::optional<ClassImage> image_;     ///< the latest that was read
  Nanoseconds image_time_ = never;      ///< its running time
  std::optional<Head> head_;
  WarnOnce warn_of_missing_{GST_CAT_DEFAULT};
  WarnOnce warn_of_times_{GST_CAT_DEFAULT};
};

}  // namespace

DEFINE_EVENT_AGGREGATOR(GstEventLabel, gst_event_label, EVENT_LABEL, EventLabeller, eventlabel,
                        GST_RANK_NONE, "classes of events")

static void gst_event_label_class_init(GstEventLabelClass* klass) {
  auto* const aggregator = GST_EVENT_AGGREGATOR_CLASS(klass);
  add_aggregator_pad_template(aggregator, "event_sink", GST_PAD_SINK, EVENT_CAPS);
  add_aggregator_pad_template(aggregator, "video_sink", GST_PAD_SINK,
                              "video/x-raw, format = (string) { GRAY8, GRAY16_LE }, " SIZE_CAPS
                              ", framerate = (fraction) [ 0, max ]");
  add_aggregator_pad_template(aggregator, "src", GST_PAD_SRC, EVENT_CAPS);
  set_metadata(klass, "Event labeller", "Filter",
               "Labels events with the class of the object that they show");
}
