// SPDX-License-Identifier: LGPL-2.1-or-later
// Marks the pixels that fire between two frames, or in steps between successive frames of a ring.
// Four pixels per invocation; each row of groups is a row of pixels, each layer a step.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Before { uint before[]; };
layout(std430, binding = 1) readonly buffer Now { uint now[]; };
layout(std430, binding = 2) writeonly buffer Fired { uvec2 fired[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int words_across;
layout(location = 2) uniform int marks_across;
layout(location = 3) uniform int first_mark;
layout(location = 4) uniform int positive;
layout(location = 5) uniform int negative;
layout(location = 6) uniform int first_step;  // frame before the first layer
layout(location = 7) uniform int ring_size;   // 1 if each buffer has one frame

// Per 32 pixels: a bit for each that fires, and one for each that fires ON.
shared uint changed[8];
shared uint brighter[8];

void main() {
  int lane = int(gl_LocalInvocationID.x);
  int word = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (lane < 8) {
    changed[lane] = 0u;
    brighter[lane] = 0u;
  }
  barrier();
  int rows = int(gl_NumWorkGroups.y);
  int step = first_step + int(gl_WorkGroupID.z);
  if (word < words_across) {
    uint was = before[(step % ring_size * rows + y) * words_across + word];
    uint is = now[((step + 1) % ring_size * rows + y) * words_across + word];
    uint fires = 0u;
    uint rises = 0u;
    for (int i = 0; i < 4; ++i) {
      if (word * 4 + i >= width) break;
      int change = int(is >> (8 * i) & 255u) - int(was >> (8 * i) & 255u);
      if (change > positive) rises |= 1u << i;
      if (change > positive || -change > negative) fires |= 1u << i;
    }
    int shift = 4 * (lane % 8);
    if (fires != 0u) atomicOr(changed[lane / 8], fires << shift);
    if (rises != 0u) atomicOr(brighter[lane / 8], rises << shift);
  }
  barrier();
  int mark = int(gl_WorkGroupID.x) * 8 + lane;
  if (lane < 8 && mark < marks_across)
    fired[first_mark + (int(gl_WorkGroupID.z) * rows + y) * marks_across + mark] =
        uvec2(changed[lane], brighter[lane]);
}
