// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

/// Author of all elements.
#define EVENTSIM_AUTHORS "The gst-eventsim authors"
