// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/hdf5_dataset.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <new>

#include "src/core/byte_order.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_filters.hpp"

namespace eventcamera {

namespace {

/// Limit for chunks, because the library decompresses a chunk as a whole.
constexpr std::size_t max_chunk_bytes = std::size_t{64} << 20;
constexpr std::size_t max_type_bytes = 4096;
constexpr std::size_t max_columns = 4;
constexpr std::uint64_t max_holes = 1024;
constexpr std::size_t min_cache_bytes = std::size_t{1} << 20;

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw UnsupportedFormat("HDF5 dataset " + path + " " + why);
}

}  // namespace

bool Hdf5Dataset::exists(hid_t parent, const std::string& path, H5O_type_t type) {
  for (std::size_t end = 0; end < path.size();) {
    end = std::min(path.find('/', end + 1), path.size());
    H5L_info_t link;
    if (H5Lget_info(parent, path.substr(0, end).c_str(), &link, H5P_DEFAULT) < 0 ||
        link.type != H5L_TYPE_HARD)
      return false;
  }
  const Hdf5Handle object(H5Oopen(parent, path.c_str(), H5P_DEFAULT), H5Oclose);
  const auto kind = H5Iget_type(object.get());
  return kind == (type == H5O_TYPE_GROUP ? H5I_GROUP : H5I_DATASET);
}

Hdf5Dataset::Hdf5Dataset(hid_t parent, const std::string& path) : path_(path) {
  if (!exists(parent, path, H5O_TYPE_DATASET)) refuse(path, "is missing");
  dataset_ = {H5Dopen2(parent, path.c_str(), H5P_DEFAULT), H5Dclose};
  type_ = {H5Dget_type(dataset_.get()), H5Tclose};
  const Hdf5Handle space(H5Dget_space(dataset_.get()), H5Sclose);
  creation_ = {H5Dget_create_plist(dataset_.get()), H5Pclose};
  if (!dataset_ || !type_ || !space || !creation_) refuse(path, "cannot be opened");
  type_bytes_ = H5Tget_size(type_.get());
  if (type_bytes_ == 0 || type_bytes_ > max_type_bytes)
    refuse(path, "has elements that are too large");
  if (const auto number = number_of(type_.get())) numbers_.push_back(*number);

  if (H5Sget_simple_extent_type(space.get()) == H5S_NULL) refuse(path, "is empty by declaration");
  const int rank = H5Sget_simple_extent_ndims(space.get());
  if (rank < 0 || rank > 2) refuse(path, "has too many dimensions");
  extent_.resize(static_cast<std::size_t>(rank));
  if (rank > 0 && H5Sget_simple_extent_dims(space.get(), extent_.data(), nullptr) != rank)
    refuse(path, "has a corrupt extent");
  if (columns() == 0 || columns() > max_columns) refuse(path, "has too many columns, or none");
  if (H5Pget_layout(creation_.get()) == H5D_CHUNKED) check_chunks();
  check_storage(parent);
}

void Hdf5Dataset::check_chunks() {
  chunk_.resize(extent_.size());
  if (extent_.empty() || H5Pget_chunk(creation_.get(), rank(), chunk_.data()) != rank())
    refuse(path_, "has corrupt chunks");
  chunk_bytes_ = type_bytes_;
  for (const auto side : chunk_) {
    if (side == 0 || side > max_chunk_bytes / chunk_bytes_)
      refuse(path_, "has chunks that are too large");
    chunk_bytes_ *= side;
  }
  const int count = H5Pget_nfilters(creation_.get());
  for (int i = 0; i < count; ++i) {
    unsigned flags = 0;
    std::size_t values = 0;
    filters_.push_back(H5Pget_filter2(creation_.get(), static_cast<unsigned>(i), &flags, &values,
                                      nullptr, 0, nullptr, nullptr));
  }
  own_filters_ = std::ranges::all_of(filters_, is_own_hdf5_filter);
  // Nested compression multiplies ratios: 100 kB could expand to terabytes.
  const auto compressions = std::ranges::count_if(filters_, [](int filter) {
    return filter != H5Z_FILTER_SHUFFLE && filter != H5Z_FILTER_FLETCHER32 &&
           filter != H5Z_FILTER_NBIT && filter != H5Z_FILTER_SCALEOFFSET;
  });
  if (compressions > 1) refuse(path_, "is compressed more than once");
}

/// Determines how many of the rows stated in the file are actually stored.
void Hdf5Dataset::check_storage(hid_t file) {
  hsize_t file_bytes = 0;
  if (H5Fget_filesize(file, &file_bytes) < 0) refuse(path_, "has a file of unknown size");
  file_bytes_ = file_bytes;
  const std::uint64_t claimed = claimed_rows();
  const auto row_bytes = columns() * type_bytes_;
  switch (H5Pget_layout(creation_.get())) {
    case H5D_CHUNKED: {
      hsize_t chunks = 0;
      const Hdf5Handle space(H5Dget_space(dataset_.get()), H5Sclose);
      if (claimed > 0 && H5Dget_num_chunks(dataset_.get(), space.get(), &chunks) < 0)
        refuse(path_, "has a corrupt index of its chunks");
      // A crafted index may refer to one chunk many times, so that a small file never ends.
      if (H5Dget_storage_size(dataset_.get()) > file_bytes_)
        refuse(path_, "has chunks that overlap");
      // Bounds the number of missing chunks, which take time to skip.
      const auto max_chunks = 2 * std::min<std::uint64_t>(chunks, UINT32_MAX) + max_holes;
      const auto max_rows = std::min<std::uint64_t>(max_chunks, UINT64_MAX / chunk_[0]) * chunk_[0];
      rows_ = std::min<std::uint64_t>(claimed, max_rows);
      return;
    }
    case H5D_CONTIGUOUS: {
      if (H5Pget_external_count(creation_.get()) != 0) refuse(path_, "is stored in another file");
      const auto offset = H5Dget_offset(dataset_.get());
      if (offset == HADDR_UNDEF || offset > file_bytes_) return;
      rows_ = std::min<std::uint64_t>({claimed, (file_bytes_ - offset) / row_bytes,
                                       H5Dget_storage_size(dataset_.get()) / row_bytes});
      return;
    }
    case H5D_COMPACT:
      rows_ = std::min<std::uint64_t>(claimed, H5Dget_storage_size(dataset_.get()) / row_bytes);
      return;
    default:
      refuse(path_, "has an unsupported storage layout");
  }
}

/// Loads one row of chunks.
bool Hdf5Dataset::load(std::uint64_t block) {
  if (loaded_block_ == block) return true;
  loaded_block_.reset();
  const std::uint64_t row_columns = columns();
  const auto chunk_columns =
      chunk_.size() < 2 ? 1 : std::min<std::uint64_t>(chunk_[1], row_columns);
  const auto chunk_stride = chunk_.size() < 2 ? 1 : chunk_[1];
  loaded_.resize(chunk_[0] * row_columns * type_bytes_);
  std::vector<std::uint8_t> bytes;
  for (std::uint64_t column = 0; column < row_columns; column += chunk_stride) {
    const hsize_t offset[] = {block * chunk_[0], column};
    // Incompressible chunks are stored slightly larger.
    const auto max_bytes = chunk_bytes_ + chunk_bytes_ / 64 + 1024;
    std::uint32_t filter_mask = 0;
    if (!read_stored(offset, max_bytes, bytes, filter_mask) ||
        !undo_hdf5_filters(filters_, filter_mask, type_bytes_, chunk_bytes_, bytes))
      return false;
    if (row_columns == chunk_stride) {
      loaded_.swap(bytes);
      break;
    }
    const auto part = std::min(chunk_columns, row_columns - column) * type_bytes_;
    for (std::uint64_t row = 0; row < chunk_[0]; ++row)
      std::memcpy(loaded_.data() + (row * row_columns + column) * type_bytes_,
                  bytes.data() + row * chunk_stride * type_bytes_, part);
  }
  loaded_block_ = block;
  return true;
}

/// Reads rows in their stored form.
bool Hdf5Dataset::read_elements(std::uint64_t first, std::uint64_t count,
                                std::vector<std::uint8_t>& out) {
  const auto row_bytes = columns() * type_bytes_;
  out.resize(count * row_bytes);
  if (chunk_.empty() || !own_filters_) {
    const Hdf5Handle space(H5Dget_space(dataset_.get()), H5Sclose);
    const hsize_t start[] = {first, 0};
    const hsize_t size[] = {count, columns()};
    if (!extent_.empty() &&
        H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, start, nullptr, size, nullptr) < 0)
      return false;
    const hsize_t elements = count * columns();
    const Hdf5Handle memory(H5Screate_simple(1, &elements, nullptr), H5Sclose);
    return H5Dread(dataset_.get(), type_.get(), memory.get(), space.get(), H5P_DEFAULT,
                   out.data()) >= 0;
  }
  auto* to = out.data();
  while (count > 0) {
    const auto block = first / chunk_[0];
    const auto skipped = first - block * chunk_[0];
    const auto part = std::min<std::uint64_t>(count, chunk_[0] - skipped);
    if (!load(block)) return false;
    std::memcpy(to, loaded_.data() + skipped * row_bytes, part * row_bytes);
    to += part * row_bytes;
    first += part;
    count -= part;
  }
  return true;
}

/// Widens one number of each element to 64 bits and stores it at its place in the rows of `out`.
template <class Unsigned>
void Hdf5Dataset::widen(const std::uint8_t* element, const Number& number,
                        std::span<std::int64_t> out) const {
  constexpr auto unused = 64 - 8 * sizeof(Unsigned);
  const auto step = numbers_.size();
  for (std::size_t i = 0; i < out.size(); i += step, element += type_bytes_) {
    std::uint64_t word = little_endian<Unsigned>(element);
    word = number.big_endian ? __builtin_bswap64(word) : word << unused;
    out[i] = number.is_signed ? static_cast<std::int64_t>(word) >> unused
                              : static_cast<std::int64_t>(word >> unused);
  }
}

double floating(std::int64_t bits, std::size_t bytes) {
  if (bytes == sizeof(double)) return std::bit_cast<double>(bits);
  return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
}

/// Converts the bits of a number to an integer; the smallest integer if it does not fit.
std::int64_t Hdf5Dataset::number_from(std::int64_t bits, std::size_t column) const {
  constexpr auto impossible = std::numeric_limits<std::int64_t>::min();
  constexpr double max = 4e18;
  const auto& number = numbers_[column % numbers_.size()];
  const auto power = column == time_column_ ? power_ : 0;
  if (number.is_floating) {
    auto value = floating(bits, number.bytes);
    if (column == time_column_) value = value * std::pow(10, power) + max_rounding_up;
    return std::abs(value) < max ? static_cast<std::int64_t>(std::floor(value)) : impossible;
  }
  for (auto left = power; left > 0; --left)
    if (__builtin_mul_overflow(bits, 10, &bits)) return impossible;
  if (power >= 0) return bits;
  const auto divisor = static_cast<std::int64_t>(std::pow(10, -power));
  return bits / divisor - (bits % divisor < 0 ? 1 : 0);
}

/// Widens the numbers of elements to 64 bits.
void Hdf5Dataset::read_bits(std::span<const std::uint8_t> bytes,
                            std::vector<std::int64_t>& out) const {
  out.resize(bytes.size() / type_bytes_ * numbers_.size());
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    const auto& number = numbers_[i];
    const std::span to(out.data() + i, out.size() - i);
    switch (number.bytes) {
      case 1:
        widen<std::uint8_t>(bytes.data() + number.offset, number, to);
        break;
      case 2:
        widen<std::uint16_t>(bytes.data() + number.offset, number, to);
        break;
      case 4:
        widen<std::uint32_t>(bytes.data() + number.offset, number, to);
        break;
      default:
        widen<std::uint64_t>(bytes.data() + number.offset, number, to);
    }
  }
}

bool Hdf5Dataset::read(std::uint64_t first, std::uint64_t count, std::vector<std::int64_t>& out) {
  std::vector<std::uint8_t> bytes;
  if (!read_elements(first, count, bytes)) return false;
  read_bits(bytes, out);
  const auto step = columns() * numbers_.size();
  for (std::size_t column = 0; column < step; ++column) {
    if (!numbers_[column % numbers_.size()].is_floating && (column != time_column_ || power_ == 0))
      continue;
    for (auto i = column; i < out.size(); i += step) out[i] = number_from(out[i], column);
  }
  return true;
}

bool Hdf5Dataset::sample(std::uint64_t count, std::vector<TableSample::Row>& out) {
  std::vector<std::uint8_t> bytes;
  std::vector<std::int64_t> bits;
  if (!read_elements(0, count, bytes)) return false;
  read_bits(bytes, bits);
  out.resize(count);
  const auto step = columns() * numbers_.size();
  for (std::size_t i = 0; i < bits.size(); ++i) {
    const auto& number = numbers_[i % numbers_.size()];
    out[i / step].push_back(number.is_floating ? TableNumber{floating(bits[i], number.bytes),
                                                             TableNumber::Form::floating}
                                               : TableNumber{static_cast<double>(bits[i])});
  }
  return true;
}

/// Describes a numeric type; nothing if it is unsupported.
std::optional<Hdf5Dataset::Number> Hdf5Dataset::number_of(hid_t type) {
  const auto kind = H5Tget_class(type);
  // h5py writes booleans as an enumeration of bytes.
  const Hdf5Handle integer(kind == H5T_ENUM ? H5Tget_super(type) : H5Tcopy(type), H5Tclose);
  Number number;
  number.is_floating = H5Tget_class(integer.get()) == H5T_FLOAT;
  if (H5Tequal(integer.get(), H5T_IEEE_F64LE) > 0 || H5Tequal(integer.get(), H5T_IEEE_F32LE) > 0) {
    number.bytes = H5Tget_size(integer.get());
    return number;
  }
  if (H5Tget_class(integer.get()) != H5T_INTEGER) return std::nullopt;
  number.bytes = H5Tget_size(integer.get());
  number.is_signed = H5Tget_sign(integer.get()) != H5T_SGN_NONE;
  number.big_endian = H5Tget_order(integer.get()) == H5T_ORDER_BE;
  const bool whole =
      number.bytes == 1 || number.bytes == 2 || number.bytes == 4 || number.bytes == 8;
  if (!whole || H5Tget_precision(integer.get()) != 8 * number.bytes ||
      H5Tget_size(type) != number.bytes)
    return std::nullopt;
  return number;
}

std::vector<std::string> Hdf5Dataset::members() const {
  std::vector<std::string> names;
  if (H5Tget_class(type_.get()) != H5T_COMPOUND || columns() != 1) return names;
  const int count = H5Tget_nmembers(type_.get());
  for (int i = 0; i < count; ++i) {
    char* const name = H5Tget_member_name(type_.get(), static_cast<unsigned>(i));
    names.emplace_back(name != nullptr ? name : "");
    H5free_memory(name);
  }
  return names;
}

void Hdf5Dataset::choose(std::span<const std::string> members) {
  if (H5Tget_class(type_.get()) != H5T_COMPOUND || columns() != 1)
    refuse(path_, "does not hold rows of named members");
  for (const auto& member : members) {
    const int found = H5Tget_member_index(type_.get(), member.c_str());
    const auto index = static_cast<unsigned>(found);
    const Hdf5Handle type(found < 0 ? -1 : H5Tget_member_type(type_.get(), index), H5Tclose);
    auto number = number_of(type.get());
    if (number) number->offset = H5Tget_member_offset(type_.get(), index);
    if (!number || number->offset > type_bytes_ || number->bytes > type_bytes_ - number->offset)
      refuse(path_, "has no number as its member " + member);
    numbers_.push_back(*number);
  }
}

bool Hdf5Dataset::read_stored(const hsize_t* offset, std::size_t max_stored,
                              std::vector<std::uint8_t>& out, std::uint32_t& filter_mask) {
  if (filters_.empty()) {
    // The library reads as many bytes as the file's index states, without reporting the number
    // beforehand, but not more than the file has. Untouched pages of this buffer take no memory.
    if (!scratch_) {
      const auto max_bytes = std::min<std::uint64_t>(file_bytes_, UINT32_MAX);
      scratch_.reset(static_cast<std::uint8_t*>(
          std::calloc(std::max<std::size_t>(max_bytes, chunk_bytes_), 1)));
      if (!scratch_) throw std::bad_alloc();
    }
    if (chunk_bytes_ > max_stored ||
        H5Dread_chunk(dataset_.get(), H5P_DEFAULT, offset, &filter_mask, scratch_.get()) < 0)
      return false;
    out.assign(scratch_.get(), scratch_.get() + chunk_bytes_);
    return true;
  }
  hsize_t bytes = 0;
  if (H5Dget_chunk_storage_size(dataset_.get(), offset, &bytes) < 0 || bytes == 0 ||
      bytes > max_stored)
    return false;
  out.resize(bytes);
  return H5Dread_chunk(dataset_.get(), H5P_DEFAULT, offset, &filter_mask, out.data()) >= 0;
}

bool Hdf5Dataset::read_chunk(std::uint64_t row, std::size_t max_stored,
                             std::vector<std::uint8_t>& out) {
  const hsize_t offset[] = {row, 0};
  std::uint32_t filter_mask = 0;
  return read_stored(offset, max_stored, out, filter_mask) && filter_mask == 0;
}

std::uint64_t Hdf5Dataset::position(std::uint64_t row) const {
  if (!chunk_.empty()) {
    std::vector<hsize_t> offset(extent_.size());
    offset[0] = row / chunk_[0] * chunk_[0];
    haddr_t address = 0;
    hsize_t bytes = 0;
    unsigned filter_mask = 0;
    const bool known = H5Dget_chunk_info_by_coord(dataset_.get(), offset.data(), &filter_mask,
                                                  &address, &bytes) >= 0;
    return known && address != HADDR_UNDEF ? address : 0;
  }
  const auto offset = H5Dget_offset(dataset_.get());
  return offset == HADDR_UNDEF ? 0 : offset;
}

void Hdf5Dataset::require_filters() {
  struct Name {
    int filter;
    const char* name;
  };
  static constexpr Name names[] = {{307, "bzip2"},        {32001, "Blosc"},     {32004, "LZ4"},
                                   {32008, "bitshuffle"}, {32015, "Zstandard"}, {32026, "Blosc2"},
                                   {ecf_filter, "ECF"}};
  if (own_filters_) return;
  for (const int filter : filters_) {
    if (filter >= 0 && H5Zfilter_avail(filter) > 0) continue;
    const auto* const known = std::ranges::find(names, filter, &Name::filter);
    const auto name = known == std::end(names) ? std::to_string(filter) : known->name;
    refuse(path_, "is compressed with the HDF5 filter " + name +
                      ", whose plugin is not installed (or not in HDF5_PLUGIN_PATH)");
  }
  // The cache must hold a chunk: the library would decompress it again for every read.
  const Hdf5Handle access(H5Pcreate(H5P_DATASET_ACCESS), H5Pclose);
  H5Pset_chunk_cache(access.get(), H5D_CHUNK_CACHE_NSLOTS_DEFAULT,
                     std::max(min_cache_bytes, chunk_bytes_), 1.0);
  const Hdf5Handle file(H5Iget_file_id(dataset_.get()), H5Fclose);
  dataset_ = {H5Dopen2(file.get(), path_.c_str(), access.get()), H5Dclose};
  if (!dataset_) refuse(path_, "cannot be opened");
}

}  // namespace eventcamera
