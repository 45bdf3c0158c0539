// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace eventcamera {

/// Pixels [first, last) of a row.
struct Run {
  int y;
  int first;
  int last;

  int width() const { return last - first; }
};

}  // namespace eventcamera
