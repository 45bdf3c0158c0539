// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <hwy/highway.h>
#include <hwy/targets.h>

#include <cstdint>

/// The SIMD targets that this processor has.
namespace targets {

/// Runs a body with each of them chosen in turn.
template <class Body>
void for_each(const Body& body) {
  const auto choose = [](std::int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  };
  for (const auto target : hwy::SupportedAndGeneratedTargets()) {
    choose(target);
    body(hwy::TargetName(target));
    choose(0);  // whichever is best
  }
}

}  // namespace targets
