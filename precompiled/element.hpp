// SPDX-License-Identifier: LGPL-2.1-or-later
// What most elements include.
#include <gst/base/gstbasetransform.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include "precompiled/core.hpp"
