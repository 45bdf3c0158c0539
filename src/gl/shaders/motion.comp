// SPDX-License-Identifier: LGPL-2.1-or-later
// Replaces the flow of each point by its motion per step, in 1/65536 of a pixel. Removes points that
// leave the frame and, if they must arrive, those that end more than a pixel away from all pixels
// that are not 0.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Picture { uint picture[]; };
layout(std430, binding = 1) buffer Points { uvec2 points[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;
layout(location = 2) uniform int steps;
layout(location = 3) uniform int factor;  // bits of the float 65536 / steps
layout(location = 4) uniform int must_arrive;

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  uvec2 point = points[y * width + x];
  if (point.x == none) return;
  vec2 flow = clamp(uintBitsToFloat(point), -16384.0, 16384.0);
  ivec2 motion = ivec2(roundEven(flow * intBitsToFloat(factor)));
  ivec2 end = ivec2(x, y) + (motion * steps + 32768 >> 16);
  bool is_inside = end.x >= 0 && end.x < width && end.y >= 0 && end.y < height;
  bool stays = is_inside && must_arrive == 0;
  if (is_inside && must_arrive != 0)
    for (int v = max(end.y - 1, 0); v <= min(end.y + 1, height - 1); ++v)
      for (int u = max(end.x - 1, 0); u <= min(end.x + 1, width - 1); ++u)
        stays = stays ||
                (picture[v * ((width + 3) / 4) + u / 4] >> (8 * (u % 4)) & 255u) != 0u;
  points[y * width + x] = stays ? uvec2(motion) : uvec2(none);
}
