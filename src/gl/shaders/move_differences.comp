// SPDX-License-Identifier: LGPL-2.1-or-later
// Moves the pixels of a difference frame to where they are in each step from `first` on. If several
// reach the same pixel, the largest difference wins, and ON wins over an equal OFF.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Picture { uint picture[]; };
layout(std430, binding = 1) readonly buffer Motions { ivec2 motions[]; };
layout(std430, binding = 2) buffer Strongest { uint strongest[]; };  // by step; doubled, plus 1 for ON
layout(location = 0) uniform int width;
layout(location = 1) uniform int first;
layout(location = 2) uniform int steps;
layout(location = 3) uniform int is_on;

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  ivec2 motion = motions[y * width + x];
  if (motion.x == int(none)) return;
  int rows = int(gl_NumWorkGroups.y);
  uint difference = picture[y * ((width + 3) / 4) + x / 4] >> (8 * (x % 4)) & 255u;
  for (int i = 0; i < steps; ++i) {
    ivec2 at = ivec2(x, y) + (motion * (first + i) + 32768 >> 16);
    atomicMax(strongest[(i * rows + at.y) * width + at.x], 2u * difference + uint(is_on));
  }
}
