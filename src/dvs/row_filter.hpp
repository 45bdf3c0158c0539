// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/dvs/light_response.hpp"
#include "src/dvs/pixel_array.hpp"

namespace eventcamera {

/// A pixel in which something may happen, and the light that it sees.
struct Candidate {
  int x;
  int shade;
  float last_target;  ///< as the segment begins
  float last_signal;
};

/// Those of a row, apart: what takes different ways is quicker worked on kind by kind.
struct Candidates {
  std::vector<Candidate> quiet;  ///< without shot noise in the segment
  std::vector<Candidate> noisy;

  void clear() {
    quiet.clear();
    noisy.clear();
  }
};

/// What all pixels of a segment share.
struct Screen {
  const LightResponse& response;
  const ShadeTables& tables;
  int bits;        ///< of the luma
  float duration;  ///< microseconds
  float share;     ///< of the way to the luma's response that the light goes
  float rise;      ///< of all signals besides, units of the response
  bool has_bandwidth;
  bool has_noise;
};

/// Takes a row of pixels through a segment: targets and signals of all; references and noise of
/// those in which nothing can happen, which are most. The others are left as they were, and
/// `candidates` holds them. That is decided with a little more room than the rounding of floats,
/// and the same way on every processor.
void pass_row(const Screen& screen, const std::uint8_t* luma, int y, PixelArray& pixels,
              Candidates& candidates);
void pass_row(const Screen& screen, const std::uint16_t* luma, int y, PixelArray& pixels,
              Candidates& candidates);

}  // namespace eventcamera
