// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <exception>

/// Tells the user of an element what is wrong with the file that it reads.
class ReadingFaults {
 public:
  /// Errors are of this code, which tells what the element does with a file.
  ReadingFaults(GstElement* element, GstStreamError code) : element_(element), code_(code) {}

  /// Runs what may throw; an exception is an error of the element.
  template <class Work>
  GstFlowReturn guard(const Work& work) {
    try {
      return work();
    } catch (const std::exception& error) {
      return fail(error);
    }
  }

  /// Corruption is reported where it first shows; how much there is in the end is in the
  /// statistics.
  void warn_of_corruption(guint64 at, const char* what);

  /// Another file comes.
  void begin_anew() { warned_of_corruption_ = false; }

 private:
  GstFlowReturn fail(const std::exception& error);

  GstElement* element_;
  GstStreamError code_;
  bool warned_of_corruption_ = false;
};
