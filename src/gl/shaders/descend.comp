// SPDX-License-Identifier: LGPL-2.1-or-later
// Gives each block of a level twice the flow of the block of the coarser level that contains it.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Coarser { uvec2 coarser[]; };
layout(std430, binding = 1) buffer Blocks { uvec2 blocks[]; };
layout(location = 0) uniform int width;  // in blocks

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width || blocks[y * width + x].x == none) return;
  vec2 flow = uintBitsToFloat(coarser[y / 2 * ((width + 1) / 2) + x / 2]);
  blocks[y * width + x] = floatBitsToUint(2.0 * flow);
}
