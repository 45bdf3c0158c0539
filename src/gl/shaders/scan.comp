// SPDX-License-Identifier: LGPL-2.1-or-later
// Replaces each count by the sum of all counts before it, and stores the total. A single group.
layout(local_size_x = 128) in;

layout(std430, binding = 0) buffer Counts { uint counts[]; };
layout(std430, binding = 1) writeonly buffer Total { uint total; };
layout(location = 0) uniform int size;

shared uint sums[128];

void main() {
  int lane = int(gl_LocalInvocationID.x);
  uint before = 0u;
  for (int first = 0; first < size; first += 128) {
    int i = first + lane;
    uint count = i < size ? counts[i] : 0u;
    sums[lane] = count;
    barrier();
    for (int stride = 1; stride < 128; stride <<= 1) {
      uint left = lane >= stride ? sums[lane - stride] : 0u;
      barrier();
      sums[lane] += left;
      barrier();
    }
    if (i < size) counts[i] = before + sums[lane] - count;
    before += sums[127];
    barrier();
  }
  if (lane == 0) total = before;
}
