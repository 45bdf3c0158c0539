// SPDX-License-Identifier: LGPL-2.1-or-later
// What most tests of the event core include.
#include <gtest/gtest.h>
#include <random>
#include "precompiled/core.hpp"
