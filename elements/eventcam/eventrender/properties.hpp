// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <glib-object.h>

namespace eventrender {

/// For class_init: what the application sets.
void install_properties(GObjectClass* object_class);

}  // namespace eventrender
