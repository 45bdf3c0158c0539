// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <condition_variable>
#include <deque>
#include <limits>
#include <mutex>
#include <optional>
#include <vector>

#include "gst/base/errors.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/owned.hpp"
#include "src/core/event.hpp"

/// Running time, negative before the start of a segment; none for times that are invalid or more
/// than 146 years away.
std::optional<eventcamera::Nanoseconds> running_time_of(const GstSegment& segment,
                                                        GstClockTime time);

/// Optional sink pad of a simulator, whose buffers belong to the frames of the video: class images
/// or optical flow. Both are matched by running time. The video's thread waits for the buffers up
/// to the time of its frame; the pad's thread waits while a buffer after that time is queued.
class CompanionPad {
 public:
  using Nanoseconds = eventcamera::Nanoseconds;

  struct Item {
    Nanoseconds time;  ///< running time
    OwnedBuffer buffer;
    OwnedCaps caps;
  };

  /// `content` is what the buffers are, for messages: "class images".
  CompanionPad(const char* content, GstDebugCategory* category)
      : content_(content), warn_of_times_(category), warn_of_number_(category) {}
  CompanionPad(const CompanionPad&) = delete;
  CompanionPad& operator=(const CompanionPad&) = delete;

  /// For request_new_pad: adds the pad, unless there is one.
  GstPad* add_to(GstElement* element, GstPadTemplate* pad_template);
  /// For release_pad.
  void remove_from(GstElement* element, GstPad* pad);

  /// Threads only wait from start to stop.
  void start();
  void stop();

  /// Returns the pad, if there is one.
  OwnedPad pad();
  /// True if a stream is linked to the pad.
  bool is_linked();

  // Of the video. Its thread calls all but the first two.

  void set_flushing(bool is_flushing);
  /// Both streams are sought to where time starts over, this one first.
  void set_seeking(bool is_seeking);
  /// Time starts over.
  void begin();
  /// The video has reached `time`. Of the buffers up to `start`, only the last is still needed.
  void advance(Nanoseconds start, Nanoseconds time);
  /// No frames follow.
  void end() { advance(forever, forever); }
  /// No frames follow in this segment.
  void end_segment() { advance(forever, forever - 1); }
  /// Waits until the buffers up to `until` are known. Returns the last one that is not after
  /// `from`, and all later ones up to `until`; nullopt if the stream is flushing.
  std::optional<std::vector<Item>> items(Nanoseconds from, Nanoseconds until);

 private:
  struct Functions;  ///< of the pad

  static constexpr Nanoseconds forever = std::numeric_limits<Nanoseconds>::max() / 2;
  static constexpr Nanoseconds never = -forever;
  /// Times closer than this are equal, since streams round them differently.
  static constexpr auto resolution = Nanoseconds{event_resolution};
  /// Limit of the buffers between two frames.
  static constexpr std::size_t max_items = 256;

  template <class Change>
  void change(const Change& change) {
    {
      const std::lock_guard lock(mutex_);
      change();
    }
    changed_.notify_all();
  }

  GstFlowReturn push(GstElement* element, OwnedBuffer buffer);
  void take_event(GstEvent* event);
  void forget();
  void begin_segment();

  const char* content_;

  // Accessed by the pad's thread only.
  GstSegment segment_{};
  OwnedCaps caps_;
  WarnOnce warn_of_times_;
  WarnOnce warn_of_number_;

  std::mutex mutex_;  ///< of all below
  std::condition_variable changed_;
  GstPad* pad_ = nullptr;
  bool is_linked_ = false;
  bool is_stopped_ = true;
  bool is_flushing_ = false;
  bool is_video_flushing_ = false;
  bool is_seeking_ = false;
  bool is_segment_done_ = false;
  std::deque<Item> items_;        ///< in order of time
  Nanoseconds known_ = never;     ///< all buffers before this time are queued
  Nanoseconds position_ = never;  ///< of the video
};
