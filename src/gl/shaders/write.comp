// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes the events of the marks in the layout of Event, by step, then in raster order.
layout(local_size_x = 128) in;

layout(std430, binding = 0) readonly buffer Fired { uvec2 fired[]; };
layout(std430, binding = 1) readonly buffer Starts { uint starts[]; };  // of the blocks
layout(std430, binding = 2) readonly buffer Times { uint times[]; };
layout(std430, binding = 3) writeonly buffer Events { uvec2 events[]; };
layout(location = 0) uniform int marks_a_step;
layout(location = 1) uniform int marks_across;
layout(location = 2) uniform int capacity;

shared uint sums[128];

void main() {
  int lane = int(gl_LocalInvocationID.x);
  int first = int(gl_GlobalInvocationID.x) * 4;
  int step_start = int(gl_WorkGroupID.y) * marks_a_step;
  int end = min(first + 4, marks_a_step);
  uint count = 0u;
  for (int i = first; i < end; ++i) count += uint(bitCount(fired[step_start + i].x));
  sums[lane] = count;
  barrier();
  for (int stride = 1; stride < 128; stride <<= 1) {
    uint left = lane >= stride ? sums[lane - stride] : 0u;
    barrier();
    sums[lane] += left;
    barrier();
  }
  uint at = starts[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x] + sums[lane] - count;
  uint t = times[gl_WorkGroupID.y];
  for (int i = first; i < end; ++i) {
    uvec2 mark = fired[step_start + i];
    uint y = uint(i / marks_across);
    uint left = uint(i % marks_across) * 32u;
    for (uint bits = mark.x; bits != 0u && at < uint(capacity); bits &= bits - 1u, ++at) {
      uint bit = uint(findLSB(bits));
      events[at] = uvec2(t, left + bit | y << 16 | (mark.y >> bit & 1u) << 31);
    }
  }
}
