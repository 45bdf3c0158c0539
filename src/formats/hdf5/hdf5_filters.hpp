// SPDX-License-Identifier: LGPL-2.1-or-later
// The filters that the HDF5 library packs chunks with. They are undone here, as the library trusts
// the sizes that a chunk tells.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace eventcamera {

/// Whether it is one of them: deflate, shuffle or Fletcher's sum.
bool is_own_hdf5_filter(int filter);

/// Undoes the filters of a chunk of numbers of so many bytes, the last first; a set bit of
/// `left_out` says that this filter was not applied. False where that does not make `chunk_bytes`.
bool undo_hdf5_filters(std::span<const int> filters, std::uint32_t left_out,
                       std::size_t number_bytes, std::size_t chunk_bytes,
                       std::vector<std::uint8_t>& bytes);

}  // namespace eventcamera
