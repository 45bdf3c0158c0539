// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventhdf5sink
 * @title: eventhdf5sink
 * @short_description: writes HDF5 files of events
 *
 * Writes events as an HDF5 file in the layout of DSEC or Metavision, whose arrays can be read
 * directly with h5py. Written times come from the PTS. `format=metavision` keeps triggers; the
 * property `stats` counts them.
 *
 * The file is complete at the end of the stream, or when the pipeline is stopped. If the process is
 * killed, all but the events of the last `commit-interval` can be read. A flushing seek truncates
 * the file and starts over. Events that are earlier than those already written, or outside the
 * sensor, are dropped; a warning says how many.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-dvs ! eventhdf5sink format=metavision
 * location=events.hdf5
 * ]|
 *
 * Since: 0.1
 */
#include <gst/base/gstbasesink.h>

#include <cerrno>
#include <chrono>
#include <system_error>

#include "gst/base/element_type.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/properties.hpp"
#include "gst/recording/file_extensions.hpp"
#include "gst/recording/sensor_events.hpp"
#include "gst/recording/writable_events.hpp"
#include "src/formats/hdf5/hdf5_writer.hpp"

GST_DEBUG_CATEGORY_STATIC(event_hdf5_sink_debug);
#define GST_CAT_DEFAULT event_hdf5_sink_debug

using namespace eventcamera;

namespace {

struct Settings {
  std::string location;
  Hdf5Format format = Hdf5Format::dsec;
  Hdf5Writer::Compression compression = Hdf5Writer::Compression::gzip;
  GstClockTime commit_interval = GST_SECOND;
};

/// State of the file, from caps to READY.
struct State {
  SensorSize sensor;
  std::unique_ptr<Hdf5Writer> writer;  ///< null before caps and after the end
  bool begun = false;                  ///< events were written
  bool ended = false;
};

struct Private {
  explicit Private(GstElement* of)
      : element(of), writable(of, GST_CAT_DEFAULT, GST_STREAM_ERROR_ENCODE) {}

  GstElement* const element;
  Guarded<Settings> settings;
  State state;
  WritableEvents writable;
};

}  // namespace

DEFINE_EVENT_ELEMENT(GstEventHdf5Sink, gst_event_hdf5_sink, EVENT_HDF5_SINK, GstBaseSink,
                     GST_TYPE_BASE_SINK, eventhdf5sink, GST_RANK_NONE,
                     "writer of HDF5 files of events")

static bool is_full(const std::exception& error) {
  const auto* const failed = dynamic_cast<const std::system_error*>(&error);
  const int code = failed != nullptr ? failed->code().value() : 0;
  return code == ENOSPC || code == EDQUOT || code == EFBIG;
}

/// Runs `work`; reports any exception and ends the file, because it cannot be repaired.
template <class Work>
static bool reported(Private& self, const Work& work) {
  return catch_exceptions(
      self.element,
      [&](const std::exception& error) {
        self.state.writer.reset();
        self.state.ended = true;
        const std::string location = self.settings.copy().location;
        if (is_full(error))
          return Report{GST_RESOURCE_ERROR_NO_SPACE_LEFT,
                        "The disk is full, or limits the size of files. " + location +
                            " can be read up to its last commit."};
        return WritableEvents::failure(
            error, {GST_RESOURCE_ERROR_WRITE,
                    "Cannot write " + location +
                        ". Set location to a writable folder on a disk with enough space."});
      },
      work);
}

static bool end_file(Private& self) {
  State& state = self.state;
  state.ended = true;
  const auto writer = std::exchange(state.writer, nullptr);
  if (writer) {
    GST_DEBUG_OBJECT(self.element, "closing the file");
    self.writable.end_file();
  }
  return !writer || reported(self, [&] { writer->close(); });
}

/// Starts a new file for events of this sensor, overwriting any existing file.
static bool begin_file(Private& self, SensorSize sensor) {
  self.state = State();  // close first: HDF5 treats two open files of the same name as one
  self.state.sensor = sensor;
  self.writable.begin_file(sensor);
  const auto [location, format, compression, commit_interval] = self.settings.copy();
  GST_DEBUG_OBJECT(self.element, "writing the events of %dx%d pixels to %s", sensor.width,
                   sensor.height, location.c_str());
  const Hdf5Writer::Settings settings{format, compression, sensor,
                                      std::chrono::nanoseconds(commit_interval)};
  return reported(self, [&, &path = location] {
    self.state.writer = std::make_unique<Hdf5Writer>(path, settings);
  });
}

static gboolean set_caps(GstBaseSink* sink, GstCaps* caps) {
  auto& self = priv_of(sink);
  const State& state = self.state;
  const auto sensor = sensor_of(caps);
  if (!sensor) {
    GST_ERROR_OBJECT(self.element, "%" GST_PTR_FORMAT " are not event caps", caps);
    return FALSE;
  }
  if (state.ended) return TRUE;
  if (state.writer && state.sensor == *sensor) return TRUE;
  if (state.begun && !self.writable.accepts(*sensor)) return FALSE;
  return begin_file(self, *sensor);
}

static GstFlowReturn render(GstBaseSink* sink, GstBuffer* buffer) {
  auto& self = priv_of(sink);
  State& state = self.state;
  if (state.ended) return GST_FLOW_EOS;
  if (!state.writer) return GST_FLOW_NOT_NEGOTIATED;
  const bool written = reported(self, [&] {
    return self.writable.write(buffer, [&](const auto& events) {
      state.begun |= !events.empty();
      const auto labels = state.writer->label(self.writable.labels());
      self.writable.written().lock()->labels += labels;
      state.writer->append(events);
    });
  });
  return written ? GST_FLOW_OK : GST_FLOW_ERROR;
}

static bool write_triggers(Private& self, std::span<const Trigger> triggers) {
  const State& state = self.state;
  if (!state.writer) return true;
  return reported(self, [&] {
    const bool written = state.writer->append(triggers);
    GST_LOG_OBJECT(self.element, "%" G_GSIZE_FORMAT " triggers, %s", triggers.size(),
                   written ? "written" : "dropped: the format has none");
    if (written) self.writable.written().lock()->triggers += triggers.size();
  });
}

/// Commits waiting events although no others arrive.
static bool keep_up(Private& self) {
  const State& state = self.state;
  return !state.writer ||
         reported(self, [&] { state.writer->append(std::span<const AbsoluteEvent>()); });
}

/// Completes the file before EOS is posted to the application, and starts over after a flush.
static gboolean event(GstBaseSink* sink, GstEvent* event) {
  auto& self = priv_of(sink);
  const State& state = self.state;
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT && !plays_forwards(self.element, event, "write"))
    return FALSE;
  if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT)
    self.writable.begin_segment(segment_of(event), is_simulated(GST_BASE_SINK_PAD(sink)));
  bool done = true;
  if (GST_EVENT_TYPE(event) == GST_EVENT_EOS) done = end_file(self);
  if (GST_EVENT_TYPE(event) == GST_EVENT_FLUSH_STOP && state.sensor != SensorSize{})
    done = begin_file(self, state.sensor);
  if (GST_EVENT_TYPE(event) == GST_EVENT_GAP) done = keep_up(self);
  if (const auto triggers = triggers_of(event)) done = write_triggers(self, *triggers);
  if (!done) {
    gst_event_unref(event);
    return FALSE;
  }
  return GST_BASE_SINK_CLASS(gst_event_hdf5_sink_parent_class)->event(sink, event);
}

/// GstBaseSink calls start() and stop() in READY, where properties may still change.
static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  auto& self = priv_of(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && self.settings.copy().location.empty()) {
    GST_ELEMENT_ERROR(self.element, RESOURCE, NOT_FOUND,
                      ("No file to write to. Set the property location."), ("location is empty"));
    return GST_STATE_CHANGE_FAILURE;
  }
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_event_hdf5_sink_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    end_file(self);
    self.state = State();
  }
  return result;
}

static void gst_event_hdf5_sink_init(GstEventHdf5Sink* self) {
  self->priv = new Private(GST_ELEMENT(self));
  gst_base_sink_set_sync(GST_BASE_SINK(self), FALSE);
}

static void gst_event_hdf5_sink_class_init(GstEventHdf5SinkClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;
  Properties<field_of<&Private::settings>> properties(object_class);
  properties.add_fixed(&Settings::location, "location",
                       "File to write; an existing file is overwritten");
  properties.add_fixed(
      &Settings::format, "format", "Format of the events in the file",
      enum_type<Hdf5Format>(
          "GstEventHdf5Format",
          {{Hdf5Format::dsec, "DSEC: /events/{t,x,y,p}, /ms_to_idx, /t_offset", "dsec"},
           {Hdf5Format::metavision,
            "Metavision: /CD/events, compressed with ECF; at most 2048x2048 pixels",
            "metavision"}}));
  properties.add_fixed(
      &Settings::compression, "compression",
      "Compression of format=dsec: gzip for small files, none for speed. format=metavision ignores "
      "it, since it always uses ECF",
      enum_type<Hdf5Writer::Compression>(
          "GstEventHdf5Compression",
          {{Hdf5Writer::Compression::none, "No compression", "none"},
           {Hdf5Writer::Compression::gzip, "gzip, which every reader supports", "gzip"}}));
  properties.add_fixed(
      &Settings::commit_interval, "commit-interval",
      "Interval between flushes; data before the last flush survives a crash (ns of the clock; 0 = "
      "flush only at the end, and the same events in the same buffers make the same bytes)",
      0, G_MAXINT64);
  install_stats(
      object_class, [](GObject* object) { return priv_of(object).writable.stats(); },
      WritableEvents::stats_blurb);

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  add_pad_template(element_class, "sink", GST_PAD_SINK, EVENT_CAPS);
  set_metadata(klass, "HDF5 file sink", "Sink/File", "Writes events as HDF5: DSEC or Metavision");
  set_output_extensions(element_class, "application/x-hdf5");
  element_class->change_state = change_state;

  GstBaseSinkClass* sink_class = GST_BASE_SINK_CLASS(klass);
  sink_class->set_caps = set_caps;
  sink_class->render = render;
  sink_class->event = event;
}
