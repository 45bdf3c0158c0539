// SPDX-License-Identifier: LGPL-2.1-or-later
// Decoders of the HDF5 filters of chunks, because the library's trust sizes in the chunk.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace eventcamera {

/// Number of the filter LZF, h5py's own; its plugin in Debian cannot be loaded.
constexpr int lzf_filter = 32000;

/// True for a supported filter: deflate, LZF, shuffle or Fletcher-32.
bool is_own_hdf5_filter(int filter);

/// Undoes the filters of a chunk of numbers with `number_bytes` each, the last filter first. Bits
/// of `filter_mask` mark filters that were not applied. False unless the result has `chunk_bytes`.
bool undo_hdf5_filters(std::span<const int> filters, std::uint32_t filter_mask,
                       std::size_t number_bytes, std::size_t chunk_bytes,
                       std::vector<std::uint8_t>& bytes);

}  // namespace eventcamera
