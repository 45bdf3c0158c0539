// SPDX-License-Identifier: LGPL-2.1-or-later
// Shared by all shaders.

// First word of a point or block that does not exist.
const uint none = 0x7fffffffu;

// Position p on a row of pixels, mirrored at the ends of the row until it is inside.
int mirrored(int p, int size) {
  if (size == 1) return 0;
  while (p < 0 || p >= size) p = p < 0 ? -p : 2 * (size - 1) - p;
  return p;
}

// Position of pixel i of `to` on a row of `from` pixels: returns the first of two pixels, and the
// weight of the second one.
int place(int i, int from, int to, out float weight) {
  int numerator = (2 * i + 1) * from - to;
  int first = max(numerator, 0) / (2 * to);
  weight = 0.0;
  if (first >= from - 1) return from - 1;
  weight = max(float(numerator - first * 2 * to), 0.0) / float(2 * to);
  return first;
}

// Displacement per step, in 1/65536 of a pixel, from the bits of a flow; `factor` is 65536 / steps.
int motion_per_step(uint flow, float factor) {
  if ((flow & 0x7fffffffu) > 0x7f800000u) return 0;  // NaN
  return int(roundEven(clamp(uintBitsToFloat(flow), -16384.0, 16384.0) * factor));
}
