// SPDX-License-Identifier: LGPL-2.1-or-later
// Moves points to where they are in step j. If several reach the same pixel, the last one in raster
// order wins. In a second run, points that moved mark the pixels that they left.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Motions { ivec2 motions[]; };
layout(std430, binding = 1) buffer Winners { uint winners[]; };  // place of a point plus 1, left
layout(location = 0) uniform int width;
layout(location = 1) uniform int j;  // number of the step
layout(location = 2) uniform int marks_left;

const uint left = 0x80000000u;

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  ivec2 motion = motions[y * width + x];
  if (motion.x == int(none)) return;
  ivec2 at = ivec2(x, y) + (motion * j + 32768 >> 16);
  if (marks_left == 0)
    atomicMax(winners[at.y * width + at.x], uint(y * width + x + 1));
  else if (at != ivec2(x, y))
    winners[y * width + x] |= left;
}
