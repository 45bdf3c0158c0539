// SPDX-License-Identifier: LGPL-2.1-or-later
// Makes each pixel that changed by more than a threshold a point without motion.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Before { uint before[]; };
layout(std430, binding = 1) readonly buffer Now { uint now[]; };
layout(std430, binding = 2) writeonly buffer Points { uvec2 points[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int threshold;

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  int word = y * ((width + 3) / 4) + x / 4;
  int shift = 8 * (x % 4);
  int change = int(now[word] >> shift & 255u) - int(before[word] >> shift & 255u);
  points[y * width + x] = abs(change) > threshold ? uvec2(0) : uvec2(none);
}
