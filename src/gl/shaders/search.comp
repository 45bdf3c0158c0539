// SPDX-License-Identifier: LGPL-2.1-or-later
// Lucas-Kanade on one level of a pyramid, like search_tile() of src/flow/lucas_kanade/search. One
// point per invocation.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer From { uint from[]; };
layout(std430, binding = 1) readonly buffer Slopes { int slopes[]; };
layout(std430, binding = 2) readonly buffer To { uint to[]; };
layout(std430, binding = 3) buffer Tracks { uvec2 tracks[]; };
layout(location = 0) uniform int width;  // of the frame
layout(location = 1) uniform int level;
layout(location = 2) uniform int level_width;
layout(location = 3) uniform int level_height;

const uint none = 0x7fffffffu;
const float scale = 1.0 / 1048576.0;

ivec2 first;   // pixel of the window's corner
ivec2 offset;  // of the point in its pixel, in 1/8

// In 1/4 of a grey level.
int grey_of(uint word, int x) {
  return int(word >> (8 * (x % 4)) & 255u) * 4;
}

int word_of(int x, int y) {
  return mirrored(y, level_height) * ((level_width + 3) / 4) + x / 4;
}

int grey_to(int x, int y) {
  int u = mirrored(x, level_width);
  return grey_of(to[word_of(u, y)], u);
}

// Grey level and slopes.
ivec3 pixel(int x, int y) {
  int u = mirrored(x, level_width);
  int grey = grey_of(from[word_of(u, y)], u);
  if (x < 0 || x >= level_width || y < 0 || y >= level_height) return ivec3(grey, 0, 0);
  int slope = slopes[y * level_width + x];
  return ivec3(grey, slope << 16 >> 16, slope >> 16);
}

ivec3 between(ivec3 a, ivec3 b, int eighths) {
  return a + ((b - a) * eighths + 4 >> 3);
}

// Column u of the window, between two pixels of a row.
ivec3 across(int u, int y) {
  ivec3 left = pixel(first.x + u, y);
  if (level == 0) return left;
  return between(left, pixel(first.x + u + 1, y), offset.x);
}

// The exact sum of products is high * 256 + low.
float rounded(int high, int low) {
  return (float(high) * 256.0 + float(low)) * scale;
}

void main() {
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_WorkGroupID.y);
  if (x >= width) return;
  uvec2 track = tracks[y * width + x];
  if (track.x == none) return;
  vec2 flow = 2.0 * uintBitsToFloat(track);
  offset = ivec2(x << 3 >> level, y << 3 >> level) & 7;
  first = ivec2(x >> level, y >> level) - 7;
  vec2 part = vec2(offset) / 8.0;

  // The window is recomputed in each move, because it does not fit into registers.
  ivec3 high = ivec3(0);
  ivec3 low = ivec3(0);
  for (int u = 0; u < 15; ++u) {
    ivec3 upper = across(u, first.y);
    for (int v = 0; v < 15; ++v) {
      ivec3 lower = across(u, first.y + v + 1);
      ivec3 here = between(upper, lower, offset.y);
      upper = lower;
      ivec3 products = ivec3(here.y * here.y, here.y * here.z, here.z * here.z);
      high += products >> 8;
      low += products & 255;
    }
  }
  float xx = rounded(high.x, low.x);
  float xy = rounded(high.y, low.y);
  float yy = rounded(high.z, low.z);
  float least = (xx + yy - sqrt((xx - yy) * (xx - yy) + 4.0 * (xy * xy))) / 450.0;
  float determinant = xx * yy - xy * xy;
  bool found = least >= 1e-4 && determinant >= 1.1920929e-7;
  vec2 before = vec2(0.0);
  for (int i = 0; i < 10 && found; ++i) {
    vec2 cell = floor(flow + part);
    vec2 corner = vec2(first) + cell;
    if (any(lessThan(corner, vec2(-15.0))) || corner.x >= float(level_width) ||
        corner.y >= float(level_height)) {
      found = false;
      break;
    }
    ivec2 sums[4] = ivec2[4](ivec2(0), ivec2(0), ivec2(0), ivec2(0));
    ivec2 start = first + ivec2(cell);
    for (int u = 0; u < 15; ++u) {
      ivec3 upper = across(u, first.y);
      int upper_left = grey_to(start.x + u, start.y);
      int upper_right = grey_to(start.x + u + 1, start.y);
      for (int v = 0; v < 15; ++v) {
        ivec3 lower = across(u, first.y + v + 1);
        int lower_left = grey_to(start.x + u, start.y + v + 1);
        int lower_right = grey_to(start.x + u + 1, start.y + v + 1);
        ivec3 here = between(upper, lower, offset.y);
        sums[0] += (upper_left - here.x) * here.yz;
        sums[1] += (upper_right - here.x) * here.yz;
        sums[2] += (lower_left - here.x) * here.yz;
        sums[3] += (lower_right - here.x) * here.yz;
        upper = lower;
        upper_left = lower_left;
        upper_right = lower_right;
      }
    }
    vec2 within = flow + part - cell;
    vec2 above = vec2(sums[0]) + (vec2(sums[1]) - vec2(sums[0])) * within.x;
    vec2 below = vec2(sums[2]) + (vec2(sums[3]) - vec2(sums[2])) * within.x;
    vec2 mismatch = (above + (below - above) * within.y) * (8.0 * scale);
    vec2 move = vec2(xy * mismatch.y - yy * mismatch.x, xy * mismatch.x - xx * mismatch.y) *
                (1.0 / determinant);
    flow += move;
    if (dot(move, move) <= 0.03 * 0.03) break;
    if (i > 0 && all(lessThan(abs(move + before), vec2(0.01)))) {
      flow -= move / 2.0;
      break;
    }
    before = move;
  }
  vec2 corner = vec2(first) + floor(flow + part);
  if (any(lessThan(corner, vec2(-15.0))) || corner.x >= float(level_width) ||
      corner.y >= float(level_height))
    found = false;
  tracks[y * width + x] = level == 0 && !found ? uvec2(none) : floatBitsToUint(flow);
}
