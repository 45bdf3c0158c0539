// SPDX-License-Identifier: LGPL-2.1-or-later
// Lists the blocks of a level of a pyramid, in any order.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Blocks { uvec2 blocks[]; };
layout(std430, binding = 1) buffer Slopes { int slopes[]; };  // then the list, as made empty by slope
layout(location = 0) uniform int width;                       // in blocks
layout(location = 1) uniform int pixels;

shared int count;
shared int start;

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int place = int(gl_WorkGroupID.y) * width + x;
  bool is_first = gl_LocalInvocationID.x == 0u;
  if (is_first) count = 0;
  barrier();
  bool exists = x < width && blocks[place].x != none;
  int rank = exists ? atomicAdd(count, 1) : 0;
  barrier();
  if (is_first && count > 0) start = atomicAdd(slopes[pixels], count);
  barrier();
  if (exists) slopes[pixels + 1 + start + rank] = place;
}
