// SPDX-License-Identifier: LGPL-2.1-or-later
// The decoders of all formats that have one of their own.
#pragma once

#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat_decoder.hpp"
#include "src/formats/hdf5/hdf5_decoder.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/ros/bag_decoder.hpp"
#include "src/formats/text/csv_decoder.hpp"
#include "src/formats/text/csv_encoder.hpp"
