// SPDX-License-Identifier: LGPL-2.1-or-later
// Fits a polynomial around each pixel, like src/flow/farneback/polynomial_expansion: first along the
// columns, then along the rows. 32x4 pixels per group.
layout(local_size_x = 32, local_size_y = 4) in;

layout(std430, binding = 0) readonly buffer Picture { float picture[]; };
layout(std430, binding = 1) readonly buffer Kernels { float kernels[]; };  // FitKernels
// Planes of the coefficients of y, x, y^2, x^2 and x y.
layout(std430, binding = 2) writeonly buffer Polynomials { float polynomials[]; };
layout(location = 0) uniform int width;
layout(location = 1) uniform int height;

const int across = 42;  // pixels of a row that a group reads

shared float tile[14 * across];
shared vec3 columns[4 * across];  // fitted with each kernel: smooth, slope, bend

void main() {
  int lane = int(gl_LocalInvocationIndex);
  ivec2 corner = ivec2(gl_WorkGroupID) * ivec2(32, 4) - 5;
  for (int i = lane; i < 14 * across; i += 128) {
    ivec2 at = clamp(corner + ivec2(i % across, i / across), ivec2(0), ivec2(width, height) - 1);
    tile[i] = picture[at.y * width + at.x];
  }
  barrier();
  for (int i = lane; i < 4 * across; i += 128) {
    int middle = i + 5 * across;
    vec3 sum = vec3(kernels[0], 0.0, kernels[12]) * tile[middle];
    for (int k = 1; k <= 5; ++k) {
      float above = tile[middle - k * across];
      float below = tile[middle + k * across];
      sum += vec3(kernels[k], kernels[6 + k], kernels[12 + k]) *
             vec3(above + below, below - above, above + below);
    }
    columns[i] = sum;
  }
  barrier();
  int x = int(gl_GlobalInvocationID.x);
  int y = int(gl_GlobalInvocationID.y);
  if (x >= width || y >= height) return;
  int middle = int(gl_LocalInvocationID.y) * across + 5 + int(gl_LocalInvocationID.x);
  vec3 here = columns[middle];
  float fit[5] = float[5](kernels[0] * here.y, 0.0, kernels[0] * here.z, kernels[12] * here.x, 0.0);
  for (int k = 1; k <= 5; ++k) {
    vec3 left = columns[middle - k];
    vec3 right = columns[middle + k];
    vec3 both = left + right;
    fit[0] += kernels[k] * both.y;
    fit[1] += kernels[6 + k] * (right.x - left.x);
    fit[2] += kernels[k] * both.z;
    fit[3] += kernels[12 + k] * both.x;
    fit[4] += kernels[6 + k] * (right.y - left.y);
  }
  for (int k = 0; k < 5; ++k) polynomials[(k * height + y) * width + x] = fit[k];
}
