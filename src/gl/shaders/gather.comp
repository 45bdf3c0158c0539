// SPDX-License-Identifier: LGPL-2.1-or-later
// Makes each block that contains a point, or a block of the next finer level, a block without flow.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Finer { uvec2 finer[]; };
layout(std430, binding = 1) writeonly buffer Blocks { uvec2 blocks[]; };
layout(location = 0) uniform int width;  // in points or finer blocks
layout(location = 1) uniform int height;

void main() {
  int blocks_across = (width + 1) / 2;
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= blocks_across) return;
  bool any = false;
  for (int v = 2 * y; v < min(2 * y + 2, height); ++v)
    for (int u = 2 * x; u < min(2 * x + 2, width); ++u) any = any || finer[v * width + u].x != none;
  blocks[y * blocks_across + x] = any ? uvec2(0) : uvec2(none);
}
