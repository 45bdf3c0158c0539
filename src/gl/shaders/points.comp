// SPDX-License-Identifier: LGPL-2.1-or-later
// Makes each pixel that is not 0 a point without motion.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Picture { uint picture[]; };
layout(std430, binding = 1) writeonly buffer Points { uvec2 points[]; };
layout(location = 0) uniform int width;

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  bool is_point = (picture[y * ((width + 3) / 4) + x / 4] >> (8 * (x % 4)) & 255u) != 0u;
  points[y * width + x] = is_point ? uvec2(0) : uvec2(none);
}
