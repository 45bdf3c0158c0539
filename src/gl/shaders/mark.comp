// SPDX-License-Identifier: LGPL-2.1-or-later
// Marks the pixels that a difference has reached, and clears the differences. 32 pixels per
// invocation; each layer of groups is a step.
layout(local_size_x = 64) in;

layout(std430, binding = 0) buffer Strongest { uint strongest[]; };
layout(std430, binding = 1) writeonly buffer Fired { uvec2 fired[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int marks_across;
layout(location = 2) uniform int first_mark;

void main() {
  int mark = int(gl_GlobalInvocationID.x);
  int row = int(gl_WorkGroupID.z * gl_NumWorkGroups.y + gl_WorkGroupID.y);  // of all steps
  if (mark >= marks_across) return;
  uvec2 bits = uvec2(0);
  for (int x = 32 * mark; x < min(32 * mark + 32, width); ++x) {
    uint here = strongest[row * width + x];
    if (here == 0u) continue;
    bits |= uvec2(1u, here & 1u) << uint(x % 32);
    strongest[row * width + x] = 0u;
  }
  fired[first_mark + row * marks_across + mark] = bits;
}
