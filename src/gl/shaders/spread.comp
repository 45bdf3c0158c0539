// SPDX-License-Identifier: LGPL-2.1-or-later
// Gives points the flow of their blocks of 2x2 pixels, interpolated towards the nearest ones beside
// and above or below, like src/flow/lucas_kanade/point_tracker. Removes points of lost blocks.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Blocks { uvec2 blocks[]; };
layout(std430, binding = 1) buffer Points { uvec2 points[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;

const ivec2 region = ivec2(64);  // in blocks

uvec2 block(ivec2 at) {
  return blocks[at.y * ((width + 1) / 2) + at.x];
}

vec2 approach(vec2 own, ivec2 from, ivec2 to) {
  ivec2 end = (ivec2(width, height) + 1) / 2;
  if (any(lessThan(to, ivec2(0))) || any(greaterThanEqual(to, end)) || to / region != from / region)
    return vec2(0.0);
  uvec2 other = block(to);
  if (other.x == none) return vec2(0.0);
  return clamp(uintBitsToFloat(other) - own, -0.5, 0.5) / 4.0;
}

void main() {
  ivec2 at = ivec2(gl_GlobalInvocationID.x, gl_WorkGroupID.y);
  if (at.x >= width || points[at.y * width + at.x].x == none) return;
  uvec2 point = block(at / 2);
  if (point.x != none) {
    vec2 own = uintBitsToFloat(point);
    ivec2 side = at % 2 * 2 - 1;
    vec2 flow = own + approach(own, at / 2, at / 2 + ivec2(side.x, 0));
    point = floatBitsToUint(flow + approach(own, at / 2, at / 2 + ivec2(0, side.y)));
  }
  points[at.y * width + at.x] = point;
}
