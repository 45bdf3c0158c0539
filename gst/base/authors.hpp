// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

/// Author of all elements, and package name of the plugins.
#define EVENTSIM_AUTHORS "The gst-eventsim authors"
