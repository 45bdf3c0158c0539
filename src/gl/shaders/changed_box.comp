// SPDX-License-Identifier: LGPL-2.1-or-later
// Smallest box that holds all pixels that changed by more than a threshold. Four pixels per
// invocation.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Before { uint before[]; };
layout(std430, binding = 1) readonly buffer Now { uint now[]; };
// Left and top counted from the right and the bottom of the frame, then right and bottom; all 0 if
// the box is empty.
layout(std430, binding = 2) buffer Box { int box[4]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;
layout(location = 2) uniform int threshold;

shared int ends[2];  // of the row

void main() {
  int lane = int(gl_LocalInvocationID.x);
  int word = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (lane < 2) ends[lane] = 0;
  barrier();
  if (word < (width + 3) / 4) {
    int at = y * ((width + 3) / 4) + word;
    for (int x = 4 * word; x < min(4 * word + 4, width); ++x) {
      int shift = 8 * (x % 4);
      int change = int(now[at] >> shift & 255u) - int(before[at] >> shift & 255u);
      if (abs(change) <= threshold) continue;
      atomicMax(ends[0], width - x);
      atomicMax(ends[1], x + 1);
    }
  }
  barrier();
  if (lane > 0 || ends[1] == 0) return;
  atomicMax(box[0], ends[0]);
  atomicMax(box[1], height - y);
  atomicMax(box[2], ends[1]);
  atomicMax(box[3], y + 1);
}
