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

/// The message of an error, and its cause, which is the debug text after the code location.
std::string text_of(GstMessage* message) {
  g_autoptr(GError) error = nullptr;
  g_autofree gchar* debug = nullptr;
  gst_message_parse_error(message, &error, &debug);
  const char* cause = debug != nullptr ? std::strchr(debug, '\n') : nullptr;
  return error->message + (cause != nullptr ? std::string("\n  ") + (cause + 1) : "");
}

/// Reads the events of a recording, from any time.
class Recording {
 public:
  /// Opens a file. Throws std::runtime_error, as does next().
  explicit Recording(const char* path) {
    g_autoptr(GError) error = nullptr;
    pipeline_ = gst_parse_launch_full(
        "filesrc name=file ! decodebin " ASK_FOR_EVENTS
        " expose-all-streams=false ! appsink name=events sync=false max-buffers=2",
        nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
    if (pipeline_ == nullptr) throw std::runtime_error(error->message);
    g_autoptr(GstElement) file = gst_bin_get_by_name(GST_BIN(pipeline_), "file");
    g_object_set(file, "location", path, nullptr);
    sink_ = gst_bin_get_by_name(GST_BIN(pipeline_), "events");
    gst_element_set_state(pipeline_, GST_STATE_PLAYING);
    gst_element_get_state(pipeline_, nullptr, nullptr, time_limit * GST_USECOND);
  }
  ~Recording() {
    gst_element_set_state(pipeline_, GST_STATE_NULL);
    gst_object_unref(sink_);
    gst_object_unref(pipeline_);
  }
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  std::optional<GstClockTime> duration() const {
    gint64 duration = 0;
    if (!gst_element_query_duration(pipeline_, GST_FORMAT_TIME, &duration) || duration <= 0)
      return std::nullopt;
    return static_cast<GstClockTime>(duration);
  }

  /// Seeks to `start`, and plays until `stop` if it is valid. Returns false if that fails.
  bool seek(GstClockTime start, GstClockTime stop) {
    return gst_element_seek(pipeline_, 1, GST_FORMAT_TIME, flags, GST_SEEK_TYPE_SET,
                            static_cast<gint64>(start), GST_SEEK_TYPE_SET,
                            static_cast<gint64>(stop)) != FALSE;
  }

  /// Returns the next events, or null at the end and after the time limit.
  GstSample* next() {
    auto* sink = GST_APP_SINK(sink_);
    while (g_get_monotonic_time() < deadline_) {
      g_autoptr(GstSample) sample = gst_app_sink_try_pull_sample(sink, GST_SECOND / 10);
      throw_error();
      if (sample != nullptr || gst_app_sink_is_eos(sink)) return g_steal_pointer(&sample);
    }
    return nullptr;
  }

 private:
  void throw_error() {
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_);
    g_autoptr(GstMessage) message = gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR);
    if (message != nullptr) throw std::runtime_error(text_of(message));
  }

  static constexpr auto flags =
      static_cast<GstSeekFlags>(GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE);

  gint64 deadline_ = g_get_monotonic_time() + time_limit;
  GstElement* pipeline_;
  GstElement* sink_;
};

/// Draws the next window. Throws std::runtime_error.
std::optional<Thumbnail> draw_window(Recording& recording, int max_side) {
  std::optional<Thumbnail> picture;
  while (!picture || !picture->is_full()) {
    g_autoptr(GstSample) sample = recording.next();
    GstEventCameraInfo info{};
    if (sample == nullptr || !gst_event_camera_info_from_caps(&info, gst_sample_get_caps(sample)))
      break;
    // If the file does not state the size of the sensor, it may grow.
    const SensorSize sensor{info.width, info.height};
    if (!picture || picture->sensor() != sensor) picture.emplace(sensor, max_side);
    if (const MappedEvents events(gst_sample_get_buffer(sample)); events)
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
  g_autoptr(GOptionContext) context =
      g_option_context_new("IN OUT - draws a thumbnail of an event file, a PNG file");
  g_autoptr(GError) error = nullptr;
  g_option_context_add_main_entries(context, entries, nullptr);
  if (!g_option_context_parse(context, &argc, &argv, &error)) return error->message;
  if (options.print_version) return std::nullopt;
  if (options.files == nullptr || g_strv_length(options.files) != 2) return "needs IN and OUT";
  if (options.size < 1 || options.size > 4096) return "--size must be from 1 to 4096";
  return std::nullopt;
}

/// Returns false, and prints what to do, if GStreamer lacks the plugin eventcam.
bool has_plugin() {
  g_autoptr(GstPlugin) plugin = gst_registry_find_plugin(gst_registry_get(), "eventcam");
  if (plugin == nullptr)
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
