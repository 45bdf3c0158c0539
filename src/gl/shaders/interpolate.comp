// SPDX-License-Identifier: LGPL-2.1-or-later
// Marks the pixels that fire in the frames interpolated along a flow, like
// src/simulate/interpolation. 64 pixels of a row per group, through at most 64 steps.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Last { uint last[]; };
layout(std430, binding = 1) readonly buffer Now { uint now[]; };
layout(std430, binding = 2) readonly buffer Flows { vec2 flows[]; };
layout(std430, binding = 3) writeonly buffer Fired { uvec2 fired[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;
layout(location = 2) uniform int blends;
layout(location = 3) uniform int steps;
layout(location = 4) uniform int factor;      // bits of the float 65536 / steps
layout(location = 5) uniform int first_step;  // to be marked
layout(location = 6) uniform int last_step;
layout(location = 7) uniform int positive;
layout(location = 8) uniform int negative;

// Per 32 pixels and step: a bit for each that fires, and one for each that fires ON.
shared uint changed[128];
shared uint brighter[128];

int grey(bool is_now, int x, int y) {
  int word = y * ((width + 3) / 4) + x / 4;
  return int((is_now ? now[word] : last[word]) >> (8 * (x % 4)) & 255u);
}

// Bilinear sample at a position in 1/65536 of a pixel, rounded to 1/64; in 1/4096 of a grey level.
int sampled(bool is_now, ivec2 at) {
  ivec2 end = ivec2(width, height) - 1;
  ivec2 rounded = clamp(at + 512 >> 10, ivec2(0), end * 64);
  ivec2 a = rounded >> 6;
  ivec2 b = min(a + 1, end);
  ivec2 part = rounded & 63;
  int upper = grey(is_now, a.x, a.y) * (64 - part.x) + grey(is_now, b.x, a.y) * part.x;
  int lower = grey(is_now, a.x, b.y) * (64 - part.x) + grey(is_now, b.x, b.y) * part.x;
  return upper * (64 - part.y) + lower * part.y;
}

// Grey level of a pixel in the frame of step j.
int shade(ivec2 at, ivec2 motion, int j) {
  if (j == 0 || j == steps) return grey(j != 0, at.x, at.y);
  int from_last = sampled(false, (at << 16) - j * motion);
  if (blends == 0) return from_last + 2048 >> 12;
  int from_now = sampled(true, (at << 16) + (steps - j) * motion);
  int weight = (j * 256 + steps / 2) / steps;
  return from_last * (256 - weight) + from_now * weight + (1 << 19) >> 20;
}

void main() {
  int lane = int(gl_LocalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  int words = 2 * (last_step - first_step + 1);
  for (int i = lane; i < words; i += 64) {
    changed[i] = 0u;
    brighter[i] = 0u;
  }
  barrier();
  ivec2 at = ivec2(gl_GlobalInvocationID.x, y);
  if (at.x < width) {
    uvec2 flow = floatBitsToUint(flows[y * width + at.x]);
    ivec2 motion = ivec2(motion_per_step(flow.x, intBitsToFloat(factor)),
                         motion_per_step(flow.y, intBitsToFloat(factor)));
    uint bit = 1u << (lane % 32);
    int before = shade(at, motion, first_step - 1);
    for (int j = first_step; j <= last_step; ++j) {
      int here = shade(at, motion, j);
      int word = 2 * (j - first_step) + lane / 32;
      if (here - before > positive) atomicOr(brighter[word], bit);
      if (here - before > positive || before - here > negative) atomicOr(changed[word], bit);
      before = here;
    }
  }
  barrier();
  int marks_across = (width + 31) / 32;
  for (int i = lane; i < words; i += 64) {
    int mark = int(gl_WorkGroupID.x) * 2 + i % 2;
    int row = (first_step - 1 + i / 2) * height + y;
    if (mark < marks_across) fired[row * marks_across + mark] = uvec2(changed[i], brighter[i]);
  }
}
