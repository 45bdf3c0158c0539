// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// Decides, in an answered allocation query, that pictures come from downstream's pool, or one of
/// ours. False where these caps are no video's.
bool decide_on_drawn_pool(GstQuery* query, GstCaps* caps);
