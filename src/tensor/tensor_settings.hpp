// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>

#include "src/core/event.hpp"

namespace eventcamera {

/// How a tensor represents the events of a window. Channel 0 of two is OFF, channel 1 ON.
enum class Representation {
  voxel_grid,    ///< polarities, shared out linearly to the two nearest of `bins` instants
  histogram,     ///< counts of OFF and of ON events
  time_surface,  ///< decayed age of the last OFF and the last ON event
  event_frame,   ///< ON minus OFF events
};

/// How the value of an event decreases with its age in a time surface, from 1.
enum class Decay {
  exponential,  ///< exp(-age / time constant)
  linear,       ///< 1 - age / time constant, at least 0
};

enum class Normalization {
  none,
  mean_std,  ///< nonzero values: mean 0, standard deviation 1
  max,       ///< largest magnitude 1
};

enum class ElementType { float32, float16, uint8 };

constexpr std::size_t size_of(ElementType type) {
  switch (type) {
    case ElementType::float32:
      return 4;
    case ElementType::float16:
      return 2;
    case ElementType::uint8:
      return 1;
  }
  return 0;
}

struct TensorSettings {
  Representation representation = Representation::voxel_grid;
  int bins = 5;  ///< of a voxel grid, at least 1
  Decay decay = Decay::exponential;
  Microseconds time_constant = 50'000;  ///< of a time surface, above 0
  Normalization normalization = Normalization::none;
  ElementType type = ElementType::float32;
};

/// Numbers in a tensor: C order, so that the column is the innermost index.
struct TensorShape {
  TensorShape(int sensor_width, int sensor_height, const TensorSettings& settings)
      : channels(channels_of(settings)), height(sensor_height), width(sensor_width) {}

  std::size_t plane() const {
    return static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
  }
  std::size_t elements() const { return static_cast<std::size_t>(channels) * plane(); }

  int channels;
  int height;
  int width;

 private:
  static int channels_of(const TensorSettings& settings) {
    switch (settings.representation) {
      case Representation::voxel_grid:
        return settings.bins;
      case Representation::histogram:
      case Representation::time_surface:
        return 2;
      case Representation::event_frame:
        break;
    }
    return 1;
  }
};

}  // namespace eventcamera
