// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Draws a thumbnail of a recording: the events of a short window.
//
//   event-thumbnail --size=256 recording.raw thumbnail.png

#include <gst/app/gstappsink.h>
#include <gst/eventcamera/eventcamera.h>

#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

#include "gst/base/event_buffer.hpp"
#include "gst/base/named_file.hpp"
#include "gst/base/pads.hpp"
#include "src/render/thumbnail.hpp"

namespace {

using eventcamera::SensorSize;
using eventcamera::Thumbnail;

/// Reading time limit. The picture shows the events that were read by then.
constexpr gint64 time_limit = gint64{10} * G_USEC_PER_SEC;

/// Maximum length of a window in the middle of a recording.
constexpr GstClockTime max_window = GST_SECOND;

struct Free {
  void operator()(GstObject* object) const { gst_object_unref(object); }
  void operator()(GstSample* sample) const { gst_sample_unref(sample); }
  void operator()(GstMessage* message) const { gst_message_unref(message); }
  void operator()(GError* error) const { g_error_free(error); }
  void operator()(gchar* text) const { g_free(text); }
  void operator()(GOptionContext* context) const { g_option_context_free(context); }
};
template <class Type>
using Owned = std::unique_ptr<Type, Free>;

/// The message of an error, and its cause, which is the debug text after the code location.
std::string text_of(GstMessage* message) {
  GError* error = nullptr;
  gchar* debug = nullptr;
  gst_message_parse_error(message, &error, &debug);
  const Owned<GError> owned_error(error);
  const Owned<gchar> owned_debug(debug);
  const char* cause = debug != nullptr ? std::strchr(debug, '\n') : nullptr;
  return std::string(error->message) + (cause != nullptr ? std::string("\n  ") + (cause + 1) : "");
}

/// Reads the events of a recording, from any time.
class Recording {
 public:
  /// Opens a file. Throws std::runtime_error, as does next().
  explicit Recording(const char* path) {
    GError* error = nullptr;
    pipeline_.reset(GST_OBJECT(gst_parse_launch_full(
        "filesrc name=file ! decodebin " ASK_FOR_EVENTS
        " expose-all-streams=false ! appsink name=events sync=false max-buffers=2",
        nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error)));
    const Owned<GError> owned(error);
    if (!pipeline_) throw std::runtime_error(error->message);
    const Owned<GstObject> file(GST_OBJECT(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "file")));
    g_object_set(file.get(), "location", path, nullptr);
    sink_.reset(GST_OBJECT(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "events")));
    gst_element_set_state(pipeline(), GST_STATE_PLAYING);
    gst_element_get_state(pipeline(), nullptr, nullptr, time_limit * GST_USECOND);
  }
  ~Recording() {
    if (pipeline_) gst_element_set_state(pipeline(), GST_STATE_NULL);
  }
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  std::optional<GstClockTime> duration() const {
    gint64 duration = 0;
    if (!gst_element_query_duration(pipeline(), GST_FORMAT_TIME, &duration) || duration <= 0)
      return std::nullopt;
    return static_cast<GstClockTime>(duration);
  }

  /// Seeks to `start`, and plays until `stop` if it is valid. Returns false if that fails.
  bool seek(GstClockTime start, GstClockTime stop) {
    return gst_element_seek(pipeline(), 1, GST_FORMAT_TIME, flags, GST_SEEK_TYPE_SET,
                            static_cast<gint64>(start), GST_SEEK_TYPE_SET,
                            static_cast<gint64>(stop)) != FALSE;
  }

  /// Returns the next events, or null at the end and after the time limit.
  Owned<GstSample> next() {
    auto* sink = GST_APP_SINK(sink_.get());
    while (g_get_monotonic_time() < deadline_) {
      Owned<GstSample> sample(gst_app_sink_try_pull_sample(sink, GST_SECOND / 10));
      throw_error();
      if (sample || gst_app_sink_is_eos(sink)) return sample;
    }
    return nullptr;
  }

 private:
  GstElement* pipeline() const { return GST_ELEMENT(pipeline_.get()); }

  void throw_error() {
    const Owned<GstObject> bus(GST_OBJECT(gst_element_get_bus(pipeline())));
    const Owned<GstMessage> message(gst_bus_pop_filtered(GST_BUS(bus.get()), GST_MESSAGE_ERROR));
    if (message) throw std::runtime_error(text_of(message.get()));
  }

  static constexpr auto flags =
      static_cast<GstSeekFlags>(GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE);

  gint64 deadline_ = g_get_monotonic_time() + time_limit;
  Owned<GstObject> pipeline_;
  Owned<GstObject> sink_;
};

/// Draws the next window. Throws std::runtime_error.
std::optional<Thumbnail> draw_window(Recording& recording, int max_side) {
  std::optional<Thumbnail> picture;
  while (!picture || !picture->is_full()) {
    const auto sample = recording.next();
    GstEventCameraInfo info{};
    if (!sample || !gst_event_camera_info_from_caps(&info, gst_sample_get_caps(sample.get())))
      break;
    // If the file does not state the size of the sensor, it may grow.
    const SensorSize sensor{info.width, info.height};
    if (!picture || picture->sensor() != sensor) picture.emplace(sensor, max_side);
    if (const MappedEvents events(gst_sample_get_buffer(sample.get())); events)
      picture->add(events.events(), events.start());
  }
  return picture;
}

/// Keeps the better of two pictures.
void keep(std::optional<Thumbnail>& best, std::optional<Thumbnail> other) {
  if (other && (!best || other->is_better_than(*best))) best = std::move(other);
}

/// Draws the busiest of three moments. If none fills the picture, draws from the start.
/// Throws std::runtime_error.
Thumbnail draw_recording(const char* path, int max_side) {
  Recording recording(path);
  std::optional<Thumbnail> best;
  if (const auto duration = recording.duration()) {
    for (const GstClockTime quarter : {1, 2, 3}) {
      const GstClockTime start = *duration / 4 * quarter;
      if (recording.seek(start, start + max_window)) keep(best, draw_window(recording, max_side));
    }
  }
  if (!best || !best->is_full()) {
    recording.seek(0, GST_CLOCK_TIME_NONE);
    keep(best, draw_window(recording, max_side));
  }
  if (!best) throw std::runtime_error("no events found");
  return *best;
}

struct Options {
  gint size = 256;
  gchar** files = nullptr;
  gboolean print_version = FALSE;
};

/// Returns the error in the options, if any.
std::optional<std::string> parse(Options& options, int& argc, char**& argv) {
  const GOptionEntry entries[] = {
      {"size", 's', 0, G_OPTION_ARG_INT, &options.size, "Maximum width and height, 256 by default",
       "PIXELS"},
      {"version", 0, 0, G_OPTION_ARG_NONE, &options.print_version, "Print the version", nullptr},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &options.files, nullptr, nullptr},
      {}};
  const Owned<GOptionContext> context(
      g_option_context_new("IN OUT - draws a thumbnail of an event file, a PNG file"));
  GError* error = nullptr;
  g_option_context_add_main_entries(context.get(), entries, nullptr);
  g_option_context_parse(context.get(), &argc, &argv, &error);
  const Owned<GError> owned(error);
  if (error != nullptr) return error->message;
  if (options.print_version) return std::nullopt;
  if (options.files == nullptr || g_strv_length(options.files) != 2) return "needs IN and OUT";
  if (options.size < 1 || options.size > 4096) return "--size must be from 1 to 4096";
  return std::nullopt;
}

/// Returns false, and prints what to do, if GStreamer lacks the plugin eventcam.
bool has_plugin() {
  const Owned<GstObject> plugin(
      GST_OBJECT(gst_registry_find_plugin(gst_registry_get(), "eventcam")));
  if (!plugin)
    std::fputs(
        "GStreamer does not find the plugin eventcam. In a checkout, enter the development shell: "
        "meson devenv -C build -w .\nOtherwise install it: the Debian package "
        "gstreamer1.0-eventcam, or as root: meson install -C build\n",
        stderr);
  return plugin != nullptr;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  gst_init(&argc, &argv);
  if (const auto misuse = parse(options, argc, argv)) {
    std::fprintf(stderr, "%s; see %s --help\n", misuse->c_str(), g_get_prgname());
    return 2;
  }
  if (options.print_version) {
    std::printf("event-thumbnail %s\n", PACKAGE_VERSION);
    return 0;
  }
  if (!has_plugin()) return 1;
  const char* in = options.files[0];
  const char* out = options.files[1];
  if (std::error_code none; std::filesystem::equivalent(in, out, none)) {
    std::fprintf(stderr, "%s and %s are the same file\n", in, out);
    return 2;
  }
  // Opening a pipe might wait forever.
  if (std::error_code none; std::filesystem::is_other(in, none)) {
    std::fprintf(stderr, "%s is not a regular file; save it to a file first\n", in);
    return 1;
  }
  const char* file = in;  // named in errors
  try {
    const std::string png = draw_recording(in, options.size).draw().png();
    file = out;
    write_bytes(out, png);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", file, error.what());
    return 1;
  }
  return 0;
}
