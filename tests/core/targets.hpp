// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <hwy/highway.h>
#include <hwy/targets.h>

#include <cstdint>

/// SIMD targets supported by this processor.
namespace targets {

/// Runs a body on each of them in turn.
template <class Body>
void for_each(const Body& body) {
  const auto choose = [](std::int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  };
  for (const auto target : hwy::SupportedAndGeneratedTargets()) {
    choose(target);
    body(hwy::TargetName(target));
    choose(0);  // back to the best one
  }
}

}  // namespace targets
