// SPDX-License-Identifier: LGPL-2.1-or-later
// Moves points to where they are in each step from `first` on. If several reach the same pixel, the
// last one in raster order wins. Points that moved mark the pixels that they left.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Motions { ivec2 motions[]; };
layout(std430, binding = 1) buffer Winners { uint winners[]; };  // by step; place of a point plus 2
layout(location = 0) uniform int width;
layout(location = 1) uniform int first;
layout(location = 2) uniform int steps;

const uint left = 1u;

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  ivec2 motion = motions[y * width + x];
  if (motion.x == int(none)) return;
  int rows = int(gl_NumWorkGroups.y);
  for (int i = 0; i < steps; ++i) {
    ivec2 at = ivec2(x, y) + (motion * (first + i) + 32768 >> 16);
    atomicMax(winners[(i * rows + at.y) * width + at.x], uint(y * width + x + 2));
    if (at != ivec2(x, y)) atomicMax(winners[(i * rows + y) * width + x], left);
  }
}
