// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/region_of_interest.hpp"

#include "src/flow/region_of_interest_flow.hpp"
#include "src/gl/shaders.hpp"

namespace eventcamera::gl {

RegionOfInterest::RegionOfInterest(const Context& gl, const LumaFormat& format)
    : format_(format),
      changed_box_(gl, "changed_box", shaders::changed_box),
      stop_outside_(gl, "stop_outside", shaders::stop_outside),
      box_(gl) {}

void RegionOfInterest::limit(const GreyFrame& before, const GreyFrame& now, int threshold,
                             const Buffer& flow) {
  const auto [width, height, bits] = format_;
  box_.assign_zeros(4 * sizeof(int));
  changed_box_.run({groups_of(64, GreyFrame::words_across(width)), height},
                   {&before.buffer(), &now.buffer(), &box_}, {width, height, threshold});
  stop_outside_.run(
      {groups_of(64, width), height}, {&box_, &flow},
      {width, height, RegionOfInterestFlow::surroundings, RegionOfInterestFlow::side_step});
}

}  // namespace eventcamera::gl
