// SPDX-License-Identifier: LGPL-2.1-or-later
// Difference frame, one picture per polarity: the rise or fall of each pixel, 0 if it does not exceed
// the threshold. Four pixels per invocation.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Before { uint before[]; };
layout(std430, binding = 1) readonly buffer Now { uint now[]; };
layout(std430, binding = 2) writeonly buffer Rises { uint rises[]; };
layout(std430, binding = 3) writeonly buffer Falls { uint falls[]; };
layout(location = 0) uniform int words_across;
layout(location = 1) uniform int positive;
layout(location = 2) uniform int negative;

void main() {
  int word = int(gl_GlobalInvocationID.x);
  if (word >= words_across) return;
  int at = int(gl_WorkGroupID.y) * words_across + word;
  uint four_rises = 0u;
  uint four_falls = 0u;
  for (int shift = 0; shift < 32; shift += 8) {
    int change = int(now[at] >> shift & 255u) - int(before[at] >> shift & 255u);
    if (change > positive) four_rises |= uint(change) << shift;
    if (-change > negative) four_falls |= uint(-change) << shift;
  }
  rises[at] = four_rises;
  falls[at] = four_falls;
}
