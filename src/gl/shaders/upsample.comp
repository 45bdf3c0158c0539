// SPDX-License-Identifier: LGPL-2.1-or-later
// Interpolates the flow of a level, found for every other row: for the found rows of the next finer
// level, or for all rows of the picture.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Found { vec2 found[]; };
layout(std430, binding = 1) writeonly buffer Flows { vec2 flows[]; };
layout(location = 0) uniform int found_width;
layout(location = 1) uniform int found_height;
layout(location = 2) uniform int width;
layout(location = 3) uniform int height;
layout(location = 4) uniform int row_step;
layout(location = 5) uniform int factor;  // of the sizes

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int row = int(gl_WorkGroupID.y);
  if (x >= width) return;
  float down;
  float right;
  int y = place(row * row_step, found_height, height, down);
  down = 0.5 * (float(y % 2) + down);
  int upper = y / 2 * found_width;
  int lower = min(y / 2 + 1, (found_height - 1) / 2) * found_width;
  int first = place(x, found_width, width, right);
  int second = right > 0.0 ? first + 1 : first;
  vec2 a = mix(found[upper + first], found[lower + first], down);
  vec2 b = mix(found[upper + second], found[lower + second], down);
  flows[row * width + x] = float(factor) * mix(a, b, right);
}
