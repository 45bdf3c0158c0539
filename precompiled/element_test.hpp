// SPDX-License-Identifier: LGPL-2.1-or-later
// What most tests of elements include.
#include <gst/check/gstharness.h>
#include <gst/video/video.h>
#include <filesystem>
#include <fstream>
#include <functional>
#include "precompiled/core_test.hpp"
