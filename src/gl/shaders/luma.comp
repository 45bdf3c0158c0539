// SPDX-License-Identifier: LGPL-2.1-or-later
// Computes the luma of a texture. Four pixels per invocation.
layout(local_size_x = 64) in;

layout(binding = 0) uniform highp sampler2D frame;
layout(std430, binding = 0) writeonly buffer Luma { uint luma[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int words_across;
layout(location = 2) uniform int weight_0;
layout(location = 3) uniform int weight_1;
layout(location = 4) uniform int weight_2;
layout(location = 5) uniform int weight_3;
layout(location = 6) uniform int alpha;  // channel, or -1
layout(location = 7) uniform int black;

void main() {
  int word = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (word >= words_across) return;
  uint four = 0u;
  for (int i = 0; i < 4; ++i) {
    int x = min(word * 4 + i, width - 1);
    ivec4 bytes = ivec4(texelFetch(frame, ivec2(x, y), 0) * 255.0 + 0.5);
    ivec4 parts = bytes * ivec4(weight_0, weight_1, weight_2, weight_3);
    int value = (parts.x + parts.y + parts.z + parts.w + (1 << 14)) >> 15;
    if (alpha >= 0) {
      int sum = value * bytes[alpha] + black * (255 - bytes[alpha]) + 128;
      value = (sum + (sum >> 8)) >> 8;  // a division by 255, rounded
    }
    four |= uint(value) << (8 * i);
  }
  luma[y * words_across + word] = four;
}
