// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <map>
#include <string>
#include <vector>

#include "tests/elements/pipeline.hpp"

struct Picture {
  GstClockTime pts;
  std::string bytes;
};

/// Output of a pad since its last segment.
struct Track {
  std::string caps;
  std::vector<eventcamera::AbsoluteEvent> events;
  std::vector<Picture> pictures;
  std::size_t gaps = 0;
  GstClockTime end = 0;
  GstSegment segment{};
  std::size_t eos = 0;
};

/// Plays an AEDAT file and records what these pads of aedatdemux give. Launch lines of sources end
/// before it; identity at their end forces push mode.
class AedatPlayer : public Pipeline {
 public:
  explicit AedatPlayer(const std::string& source,
                       const std::vector<std::string>& pads = {"events_0"})
      : Pipeline(launch(source, pads)) {
    for (const auto& pad : pads) {
      auto& track = tracks_[pad];
      const bool has_events = pad.starts_with("events");
      harness::watch(GST_BASE_SINK_PAD((*this)[pad.c_str()]),
                     {[&track, has_events](GstBuffer* buffer) { see(track, buffer, has_events); },
                      [&track](GstEvent* event) { see(track, event); }});
    }
  }
  ~AedatPlayer() { set(GST_STATE_NULL); }

  guint64 stat(const char* name) const { return Pipeline::stat("d", name); }

  /// While nothing is played.
  const Track& track(const std::string& pad) const { return tracks_.at(pad); }

 private:
  static std::string launch(const std::string& source, const std::vector<std::string>& pads) {
    auto line = source + "aedatdemux name=d";
    for (const auto& pad : pads) line += "  d." + pad + " ! queue ! fakesink name=" + pad;
    return line;
  }

  static void see(Track& track, GstBuffer* buffer, bool of_events) {
    EXPECT_GE(GST_BUFFER_PTS(buffer), track.end) << "intervals overlap";
    if (!of_events) {
      track.end = GST_BUFFER_PTS(buffer);
      track.pictures.push_back({GST_BUFFER_PTS(buffer), harness::bytes_of(buffer)});
      return;
    }
    track.end = GST_BUFFER_PTS(buffer) + GST_BUFFER_DURATION(buffer);
    EXPECT_LE(GST_BUFFER_DURATION(buffer), 10 * GST_MSECOND);
    append_events(buffer, track.events);
    for (const auto& event : harness::events_of(buffer))
      EXPECT_LE(event.t, GST_BUFFER_DURATION(buffer) / 1000);
  }

  static void see(Track& track, GstEvent* event) {
    switch (GST_EVENT_TYPE(event)) {
      case GST_EVENT_CAPS: {
        GstCaps* caps = nullptr;
        gst_event_parse_caps(event, &caps);
        track.caps = harness::text_of(harness::Owned<GstCaps>(gst_caps_ref(caps)));
        break;
      }
      case GST_EVENT_SEGMENT: {
        const auto caps = track.caps;
        track = {};
        track.caps = caps;
        gst_event_copy_segment(event, &track.segment);
        break;
      }
      case GST_EVENT_GAP: {
        const auto [start, duration] = harness::gap_of(event);
        EXPECT_GE(start, track.end);
        EXPECT_GT(duration, 0U);
        track.end = start + duration;
        ++track.gaps;
        break;
      }
      case GST_EVENT_EOS:
        ++track.eos;
        break;
      default:
        break;
    }
  }

  std::map<std::string, Track> tracks_;
};
