// SPDX-License-Identifier: LGPL-2.1-or-later
// Counts the events of each block of 512 marks. Four marks per invocation; each row of groups is a
// step.
layout(local_size_x = 128) in;

layout(std430, binding = 0) readonly buffer Fired { uvec2 fired[]; };
layout(std430, binding = 1) writeonly buffer Counts { uint counts[]; };
layout(location = 0) uniform int marks_a_step;

shared uint sums[128];

void main() {
  uint lane = gl_LocalInvocationID.x;
  int first = int(gl_GlobalInvocationID.x) * 4;
  int step_start = int(gl_WorkGroupID.y) * marks_a_step;
  uint sum = 0u;
  for (int i = first; i < min(first + 4, marks_a_step); ++i)
    sum += uint(bitCount(fired[step_start + i].x));
  sums[lane] = sum;
  for (uint stride = 64u; stride > 0u; stride >>= 1u) {
    barrier();
    if (lane < stride) sums[lane] += sums[lane + stride];
  }
  if (lane == 0u) counts[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x] = sums[0];
}
