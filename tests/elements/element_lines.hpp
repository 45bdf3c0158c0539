// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <ctime>
#include <string>
#include <vector>

#include "tests/elements/harness.hpp"
#include "tests/elements/recording_files.hpp"

/// Pipelines for every element of the plugins, built from the registry: new elements are tested
/// without being listed.
namespace element_lines {

using harness::Owned;

inline constexpr const char* frame_caps =
    "video/x-raw, format=(string)GRAY8, width=(int)64, height=(int)48, "
    "framerate=(fraction)100/1";
inline constexpr const char* event_caps =
    "application/x-event-camera, format=(string)XYTP, width=(int)64, height=(int)48, "
    "framerate=(fraction)100/1";

inline std::vector<std::string> element_names() {
  gst_init(nullptr, nullptr);
  std::vector<std::string> names;
  for (const char* plugin : {"eventcam", "eventsim", "eventsimgl"}) {
    GList* const features = gst_registry_get_feature_list_by_plugin(gst_registry_get(), plugin);
    if (features == nullptr) g_error("no plugin %s in GST_PLUGIN_PATH", plugin);
    for (const GList* item = features; item != nullptr; item = item->next)
      if (GST_IS_ELEMENT_FACTORY(item->data)) names.emplace_back(GST_OBJECT_NAME(item->data));
    gst_plugin_feature_list_free(features);
  }
  return names;
}

inline std::string test_name(const testing::TestParamInfo<std::string>& info) {
  return recording_files::test_name(info.param);
}

/// An element factory.
class Kind {
 public:
  struct Pad {
    std::string name;
    Owned<GstCaps> caps;
    GstPadPresence presence;

    bool takes(const char* other) const {
      const Owned<GstCaps> others(gst_caps_from_string(other));
      return gst_caps_can_intersect(caps.get(), others.get()) != FALSE;
    }
    bool takes_frames() const { return takes(frame_caps); }
    bool takes_events() const { return takes(event_caps); }
  };

  explicit Kind(std::string name)
      : name_(std::move(name)), factory_(gst_element_factory_find(name_.c_str())) {}
  ~Kind() { gst_object_unref(factory_); }
  Kind(const Kind&) = delete;
  Kind& operator=(const Kind&) = delete;

  const std::string& name() const { return name_; }

  /// Its pads, including those that appear on request or later, which get the number 0. Request
  /// pads for both frames and events are left out: there is one for each. eventmerge has two.
  std::vector<Pad> pads(GstPadDirection direction) const {
    std::vector<Pad> pads;
    for (const GList* item = gst_element_factory_get_static_pad_templates(factory_);
         item != nullptr; item = item->next) {
      auto* const templ = static_cast<GstStaticPadTemplate*>(item->data);
      if (templ->direction != direction) continue;
      std::string name = templ->name_template;
      if (const auto number = name.find("%u"); number != name.npos) name.replace(number, 2, "0");
      Pad pad{std::move(name), Owned<GstCaps>(gst_static_pad_template_get_caps(templ)),
              templ->presence};
      if (name_ == "eventmerge" && pad.presence == GST_PAD_REQUEST)
        pads.push_back({"sink_1", Owned<GstCaps>(gst_caps_ref(pad.caps.get())), pad.presence});
      if (pad.presence != GST_PAD_REQUEST || !pad.takes_frames() || !pad.takes_events())
        pads.push_back(std::move(pad));
    }
    return pads;
  }

  /// The element, able to start.
  Owned<GstElement> make() const {
    return Owned<GstElement>(gst_parse_launch((name_ + settings()).c_str(), nullptr));
  }

  /// The same for a launch line, named "it", with the sinks that it needs. The first pad that
  /// appears later is linked to late_sink.
  std::string launch() const {
    std::string line = name_ + settings() + " name=it";
    bool has_late_sink = false;
    for (const auto& pad : pads(GST_PAD_SRC)) {
      if (pad.presence != GST_PAD_SOMETIMES)
        line += "  it." + pad.name + " ! fakesink sync=false";
      else if (!std::exchange(has_late_sink, true))
        line += "  fakesink name=late_sink sync=false";
    }
    return line;
  }

  /// As launch(), with sources: a number of frames, the events of as many, or a file.
  std::string launch_with_sources(int frames) const {
    std::string line = launch();
    for (const auto& pad : pads(GST_PAD_SINK))
      line += "  " + source(pad, frames) + " ! it." + pad.name;
    return line;
  }

 private:
  /// What must be set before it starts.
  std::string settings() const {
    if (name_ == "eventdatagramdepay") return " width=64 height=48";
    if (name_ == "evtparse") return " format=EVT3 width=64 height=48";
    if (name_ == "eventmask" || name_ == "eventundistort") return {};  // files to read
    const Owned<GstElement> element(gst_element_factory_create(factory_, nullptr));
    if (g_object_class_find_property(G_OBJECT_GET_CLASS(element.get()), "location") == nullptr)
      return {};
    return " location=" + in_quotes(recording_files::Folder::path(name_ + ".location"));
  }

  /// Tensors of any numbers, x and y of each pixel of the frames.
  static std::string flow(int frames) {
    return "videotestsrc num-buffers=" + std::to_string(frames) +
           " ! video/x-raw, format=GRAY8, width=512, height=48, framerate=100/1 ! capssetter "
           "join=false replace=true caps=\""
           "other/tensors, format=static, num_tensors=1, types=float32, dimensions=2:64:48:1\"";
  }

  std::string source(const Pad& pad, int frames) const {
    const auto video = "videotestsrc pattern=ball num-buffers=" + std::to_string(frames) + " ! " +
                       std::string(frame_caps);
    const auto events = video + " ! eventsim-frame ! " + event_caps;
    if (name_.ends_with("depay")) return events + " ! " + name_.substr(0, name_.size() - 5) + "pay";
    if (name_ == "eventatisdec")
      return "filesrc location=" + in_quotes(recording_files::Folder::path("atis.bin"));
    if (name_ == "evtparse")
      return events + " ! evtenc ! application/x-event-camera, format=(string)EVT3";
    if (pad.takes_frames()) return video;
    if (pad.takes_events()) return events;
    if (pad.name == "flow_sink") return flow(frames);
    const auto& files = recording_files::files();
    const auto file = std::ranges::find(files, name_, &recording_files::File::reader);
    if (file == files.end()) g_error("no file for %s", name_.c_str());
    return "filesrc location=" + in_quotes(file->path());
  }

  std::string name_;
  GstElementFactory* factory_;
};

/// The elements whose inputs are events or frames, which tests can push.
inline std::vector<std::string> consumers() {
  auto names = element_names();
  std::erase_if(names, [](const auto& name) {
    return !std::ranges::all_of(Kind(name).pads(GST_PAD_SINK), [](const auto& pad) {
      return pad.takes_frames() || pad.takes_events();
    });
  });
  return names;
}

inline Owned<GstElement> launched(const std::string& line) {
  GError* error = nullptr;
  Owned<GstElement> pipeline(gst_parse_launch(("pipeline.( " + line + " )").c_str(), &error));
  if (error != nullptr) g_error("%s: %s", line.c_str(), error->message);
  gst_object_ref_sink(pipeline.get());
  const Owned<GstElement> element(gst_bin_get_by_name(GST_BIN(pipeline.get()), "it"));
  const Owned<GstElement> late_sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "late_sink"));
  if (late_sink) harness::link_late_pads(element.get(), late_sink.get());
  return pipeline;
}

/// Waits for a message, as long as the process works: gives up once it has hardly run for a minute,
/// or has run for one. Under load, time passes without it.
inline Owned<GstMessage> wait_for(GstElement* pipeline, int types) {
  constexpr std::clock_t hardly = CLOCKS_PER_SEC / 100;
  const Owned<GstBus> bus(gst_element_get_bus(pipeline));
  const std::clock_t end = std::clock() + 60 * CLOCKS_PER_SEC;
  Owned<GstMessage> message;
  for (auto before = std::clock() - hardly, now = std::clock();
       !message && now >= before + hardly && now < end; before = now, now = std::clock())
    message.reset(
        gst_bus_timed_pop_filtered(bus.get(), 60 * GST_SECOND, static_cast<GstMessageType>(types)));
  return message;
}

}  // namespace element_lines
