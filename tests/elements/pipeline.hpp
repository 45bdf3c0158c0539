// SPDX-License-Identifier: LGPL-2.1-or-later
// Pipelines of tests, and the files that they read and write.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "tests/elements/event_buffer.hpp"
#include "tests/elements/harness.hpp"

/// Path of a temporary file or folder that does not exist yet.
inline std::filesystem::path temporary_path() {
  return std::filesystem::temp_directory_path() /
         ("eventsim-test-" + std::to_string(std::random_device()()));
}

inline std::string text_in(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// A folder, deleted with this object.
class TemporaryFolder {
 public:
  TemporaryFolder() { std::filesystem::create_directories(path_); }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  std::string operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_ = temporary_path();
};

/// A file, deleted with this object.
class TemporaryFile {
 public:
  template <class Bytes = std::string>
  explicit TemporaryFile(const Bytes& bytes = {}) {
    std::ofstream(path_, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  std::string path() const { return path_; }
  /// Parts of a launch line that read and write it.
  std::string source() const { return "filesrc location=" + in_quotes(path_) + " ! "; }
  std::string sink() const { return " ! filesink location=" + in_quotes(path_); }

  std::vector<std::uint8_t> bytes() const {
    const auto text = text_in(path_);
    return {text.begin(), text.end()};
  }

 private:
  std::filesystem::path path_ = temporary_path();
};

class Pipeline {
 public:
  explicit Pipeline(const std::string& launch) {
    gst_init(nullptr, nullptr);
    GError* reason = nullptr;
    pipeline_.reset(gst_parse_launch(launch.c_str(), &reason));
    EXPECT_EQ(reason, nullptr) << launch << ": " << reason->message;
    bus_.reset(gst_element_get_bus(pipeline_.get()));
  }
  ~Pipeline() { set(GST_STATE_NULL); }
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  GstElement* get() const { return pipeline_.get(); }

  /// An element, valid as long as the pipeline.
  GstElement* operator[](const char* name) const {
    GstElement* const element = gst_bin_get_by_name(GST_BIN(get()), name);
    EXPECT_NE(element, nullptr) << name;
    gst_object_unref(element);
    return element;
  }

  /// Does not wait.
  void set(GstState state) {
    EXPECT_NE(gst_element_set_state(get(), state), GST_STATE_CHANGE_FAILURE);
  }
  bool reaches(GstState state) {
    gst_element_set_state(get(), state);
    return gst_element_get_state(get(), nullptr, nullptr, 60 * GST_SECOND) ==
           GST_STATE_CHANGE_SUCCESS;
  }

  /// Plays to the end, or to that of a segment. False after an error.
  bool play() {
    gst_element_set_state(get(), GST_STATE_PLAYING);
    return wait();
  }
  bool wait() {
    constexpr auto types =
        static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING |
                                    GST_MESSAGE_SEGMENT_DONE | GST_MESSAGE_LATENCY);
    while (const harness::Owned<GstMessage> message{
        gst_bus_timed_pop_filtered(bus_.get(), 60 * GST_SECOND, types)}) {
      end = GST_MESSAGE_TYPE(message.get());
      if (end == GST_MESSAGE_LATENCY) {
        gst_bin_recalculate_latency(GST_BIN(get()));
        continue;
      }
      if (end == GST_MESSAGE_EOS || end == GST_MESSAGE_SEGMENT_DONE) return true;
      if (end == GST_MESSAGE_ERROR) {
        error = harness::text_of(message.get());
        return false;
      }
      warnings.push_back(harness::text_of(message.get()));
    }
    end = GST_MESSAGE_UNKNOWN;
    error = "nothing happens";
    return false;
  }

  /// Does not wait.
  bool seek(GstClockTime start, GstClockTime stop = GST_CLOCK_TIME_NONE, int more_flags = 0) {
    return gst_element_seek(get(), 1, GST_FORMAT_TIME,
                            static_cast<GstSeekFlags>(GST_SEEK_FLAG_FLUSH | more_flags),
                            GST_SEEK_TYPE_SET, static_cast<gint64>(start),
                            GST_CLOCK_TIME_IS_VALID(stop) ? GST_SEEK_TYPE_SET : GST_SEEK_TYPE_NONE,
                            static_cast<gint64>(stop)) != FALSE;
  }

  GstClockTime duration() const {
    gint64 duration = -1;
    gst_element_query_duration(get(), GST_FORMAT_TIME, &duration);
    return static_cast<GstClockTime>(duration);
  }

  GstClockTime position() const {
    gint64 position = -1;
    gst_element_query_position(get(), GST_FORMAT_TIME, &position);
    return static_cast<GstClockTime>(position);
  }

  guint64 stat(const char* element, const char* name) const {
    return harness::stat_of((*this)[element], name);
  }

  std::vector<std::string> warnings;
  std::string error;
  GstMessageType end = GST_MESSAGE_UNKNOWN;  ///< what it ended with

 private:
  harness::Owned<GstElement> pipeline_;
  harness::Owned<GstBus> bus_;
};

/// A file's copy, made by these elements.
inline std::vector<std::uint8_t> copied(const TemporaryFile& in, const std::string& elements) {
  const TemporaryFile out;
  Pipeline pipeline(in.source() + elements + out.sink());
  EXPECT_TRUE(pipeline.play()) << pipeline.error;
  return out.bytes();
}

/// A pipeline that ends in events.
class Player : public Pipeline {
 public:
  explicit Player(const std::string& launch)
      : Pipeline(launch + " ! fakesink name=sink sync=false signal-handoffs=true") {
    g_signal_connect((*this)["sink"], "handoff",
                     G_CALLBACK(+[](GstElement*, GstBuffer* buffer, GstPad*, Player* self) {
                       ++self->buffers;
                       append_events(buffer, self->events);
                     }),
                     this);
  }
  ~Player() { set(GST_STATE_NULL); }

  bool play() {
    events.clear();
    buffers = 0;
    return Pipeline::play();
  }

  // Since play().
  std::vector<eventcamera::AbsoluteEvent> events;
  int buffers = 0;
};
