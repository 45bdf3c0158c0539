// SPDX-License-Identifier: LGPL-2.1-or-later
// Initializes the flow of a level with twice that of the coarser level, interpolated.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Coarser { vec2 coarser[]; };
layout(std430, binding = 1) writeonly buffer Flows { vec2 flows[]; };
layout(location = 0) uniform int coarser_width;
layout(location = 1) uniform int coarser_height;
layout(location = 2) uniform int width;
layout(location = 3) uniform int height;

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  float down;
  float right;
  int upper = place(y, coarser_height, height, down) * coarser_width;
  int lower = down > 0.0 ? upper + coarser_width : upper;
  int first = place(x, coarser_width, width, right);
  int second = right > 0.0 ? first + 1 : first;
  vec2 a = mix(coarser[upper + first], coarser[lower + first], down);
  vec2 b = mix(coarser[upper + second], coarser[lower + second], down);
  flows[y * width + x] = 2.0 * mix(a, b, right);
}
