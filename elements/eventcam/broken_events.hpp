// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// Tells the user of an element, once a stream, that it cannot take all events that come.
class BrokenEvents {
 public:
  /// `fate` is what becomes of them: "left out".
  explicit BrokenEvents(const char* fate) : fate_(fate) {}

  void warn(gpointer element, const char* what);

  /// Another stream comes.
  void begin_anew() { warned_ = false; }

 private:
  const char* fate_;
  bool warned_ = false;
};
