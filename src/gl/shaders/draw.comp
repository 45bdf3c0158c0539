// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws the polarities that fired at each pixel in any step. 64 marks of a row per group.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Fired { uvec2 fired[]; };
layout(std430, binding = 1) writeonly buffer Pixels { uint pixels[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int marks_across;
layout(location = 2) uniform int steps;
layout(location = 3) uniform int colour_of_none;
layout(location = 4) uniform int colour_of_off;
layout(location = 5) uniform int colour_of_on;
layout(location = 6) uniform int colour_of_both;

shared uint off[64];
shared uint on[64];

void main() {
  int lane = int(gl_LocalInvocationID.x);
  int mark = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  off[lane] = 0u;
  on[lane] = 0u;
  if (mark < marks_across) {
    int marks_a_step = marks_across * int(gl_NumWorkGroups.y);
    for (int i = 0; i < steps; ++i) {
      uvec2 here = fired[i * marks_a_step + y * marks_across + mark];
      off[lane] |= here.x & ~here.y;
      on[lane] |= here.x & here.y;
    }
  }
  barrier();
  int left = int(gl_WorkGroupID.x) * 2048;
  int end = min(2048, width - left);
  for (int x = lane; x < end; x += 64) {
    bool is_off = (off[x / 32] >> (x % 32) & 1u) != 0u;
    bool is_on = (on[x / 32] >> (x % 32) & 1u) != 0u;
    pixels[y * width + left + x] = uint(is_off ? (is_on ? colour_of_both : colour_of_off)
                                               : (is_on ? colour_of_on : colour_of_none));
  }
}
