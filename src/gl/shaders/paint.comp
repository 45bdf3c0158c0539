// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws an interpolated frame: the last frame with moved points. Clears the winners. Four pixels per
// invocation.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Last { uint last[]; };
layout(std430, binding = 1) readonly buffer Now { uint now[]; };
layout(std430, binding = 2) buffer Winners { uint winners[]; };
layout(std430, binding = 3) writeonly buffer Between { uint between[]; };
layout(location = 0) uniform int width;

const uint left = 0x80000000u;

uint grey(int x, int y) {
  return last[y * ((width + 3) / 4) + x / 4] >> (8 * (x % 4)) & 255u;
}

void main() {
  int words_across = (width + 3) / 4;
  int word = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (word >= words_across) return;
  uint four = 0u;
  for (int x = 4 * word; x < min(4 * word + 4, width); ++x) {
    int place = y * width + x;
    int winner = int(winners[place] & ~left) - 1;
    uint shade;
    if (winner >= 0)
      shade = grey(winner % width, winner / width);
    else if ((winners[place] & left) != 0u)
      shade = now[y * words_across + word] >> (8 * (x % 4)) & 255u;
    else
      shade = grey(x, y);
    four |= shade << (8 * (x % 4));
    winners[place] = 0u;
  }
  between[y * words_across + word] = four;
}
