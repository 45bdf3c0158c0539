// SPDX-License-Identifier: LGPL-2.1-or-later
// Moves the pixels of a difference frame to where they are in step j. If several reach the same
// pixel, the largest difference wins, and ON wins over an equal OFF.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Picture { uint picture[]; };
layout(std430, binding = 1) readonly buffer Motions { ivec2 motions[]; };
layout(std430, binding = 2) buffer Strongest { uint strongest[]; };  // doubled, plus 1 for ON
layout(location = 0) uniform int width;
layout(location = 1) uniform int j;  // number of the step
layout(location = 2) uniform int is_on;

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  ivec2 motion = motions[y * width + x];
  if (motion.x == int(none)) return;
  ivec2 at = ivec2(x, y) + (motion * j + 32768 >> 16);
  uint difference = picture[y * ((width + 3) / 4) + x / 4] >> (8 * (x % 4)) & 255u;
  atomicMax(strongest[at.y * width + at.x], 2u * difference + uint(is_on));
}
