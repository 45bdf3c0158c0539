// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <atomic>
#include <map>
#include <mutex>
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

/// Plays an AEDAT file and records what each pad of aedatdemux gives. Launch lines of sources end
/// before it; identity at their end forces push mode.
class AedatPlayer : public Pipeline {
 public:
  explicit AedatPlayer(const std::string& source) : Pipeline(source + "aedatdemux name=d") {
    g_signal_connect((*this)["d"], "pad-added", G_CALLBACK(added), this);
    g_signal_connect((*this)["d"], "no-more-pads",
                     G_CALLBACK(+[](GstElement*, AedatPlayer* self) { ++self->no_more_pads; }),
                     this);
  }
  ~AedatPlayer() { set(GST_STATE_NULL); }

  void preroll() {
    set(GST_STATE_PAUSED);
    while (no_more_pads == 0) g_usleep(1000);  // before, there are no sinks to wait for
    ASSERT_TRUE(reaches(GST_STATE_PAUSED));
  }

  guint64 stat(const char* name) const { return Pipeline::stat("d", name); }

  Track track(const std::string& pad) {
    const std::lock_guard lock(mutex_);
    return tracks_[pad];
  }

  std::atomic<int> no_more_pads = 0;

 private:
  static void added(GstElement*, GstPad* pad, AedatPlayer* self) {
    GstElement* const queue = gst_element_factory_make("queue", nullptr);
    GstElement* const sink = gst_element_factory_make("fakesink", nullptr);
    gst_bin_add_many(GST_BIN(self->get()), queue, sink, nullptr);
    gst_element_link(queue, sink);
    {
      const std::lock_guard lock(self->mutex_);
      auto& track = self->tracks_[GST_PAD_NAME(pad)] = {};
      // A pad whose caps may depend on what is linked has none yet.
      for (const auto type : {GST_EVENT_CAPS, GST_EVENT_SEGMENT})
        if (const harness::Owned<GstEvent> event{gst_pad_get_sticky_event(pad, type, 0)})
          see(track, event.get());
    }
    const std::string name = GST_PAD_NAME(pad);
    harness::watch(pad, {[self, name](GstBuffer* buffer) {
                           const std::lock_guard lock(self->mutex_);
                           see(self->tracks_[name], buffer, name.starts_with("events"));
                         },
                         [self, name](GstEvent* event) {
                           const std::lock_guard lock(self->mutex_);
                           see(self->tracks_[name], event);
                         }});
    gst_pad_link(pad, harness::static_pad(queue, "sink").get());
    gst_element_sync_state_with_parent(sink);
    gst_element_sync_state_with_parent(queue);
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

  std::mutex mutex_;
  std::map<std::string, Track> tracks_;
};
