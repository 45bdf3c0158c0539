// SPDX-License-Identifier: LGPL-2.1-or-later
// Valid tables of events: text, NumPy and HDF5.
#pragma once

#include <zlib.h>

#include <string>

#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"
#include "src/formats/numpy/npy_encoder.hpp"
#include "src/formats/numpy/npz.hpp"
#include "src/formats/text/csv_encoder.hpp"
#include "tests/formats/npz_file.hpp"
#include "tests/fuzz/seed.hpp"
#include "tests/fuzz/small_hdf5.hpp"

namespace fuzz {

using recordings::Bytes;
using recordings::bytes_of;

inline std::vector<Seed> csv_seeds() {
  std::vector<Seed> seeds;
  for (const auto& [name, description, format] : csv_formats()) {
    CsvEncoder encoder(format, {640, 480});
    seeds.push_back(
        {std::string(name), recordings::encode(encoder, few_events(1, {640, 480}, 20))});
  }
  seeds.push_back({"index", bytes_of(",t_ns,x,y,p\n0,1500,3,4,1\n1,2500,5,6,0\n")});
  seeds.push_back(
      {"floats", bytes_of("1.0e+01 3.0e+00 4.0e+00 1.0e+00\n1.2e+01 5.0e+00 6.0e+00 0.0e+00\n")});
  seeds.push_back(
      {"other", bytes_of("# a comment\n\"X\"; Y ;Pol;time [s]\r\n1;2;true;1e-3\n3;4;-1;.5\n"
                         "1.0e0;2.00;false;0.0010005\n\n7;8\n")});
  return seeds;
}

inline std::vector<Seed> npy_seeds() {
  NpyEncoder encoder;
  const auto ours = recordings::encode(encoder, few_events(1, {640, 480}, 20));
  auto other = bytes_of(std::string("\x93NUMPY\x02\x00\xa0\x00\x00\x00", 12) +
                        "{'descr': [('p', '|b1'), ('', '|V3'), (('a', 't'), '>f8'), ('x', '<f2'), "
                        "('y', '>i4', ), ('z', '<u2', (2, 3))], 'fortran_order': False, "
                        "'shape': (3,), }");
  other.resize(12 + 0xa0, ' ');
  other.resize(other.size() + 3 * 30, 0x3c);
  const std::vector<double> numbers = {0.5, 3, 4, 1, 0.75, 5, 6, 0};
  return {{"ours", ours}, {"other", other}, {"rows", npz_file::array("'<f8'", "(2, 4)", numbers)}};
}

inline std::vector<Seed> npz_seeds() {
  const SensorSize size = {640, 480};
  std::vector<Seed> seeds = {
      {"ours", recordings::encode(*make_npz_encoder(size), few_events(1, size, 20))}};
  const auto rows = npy_seeds().back().bytes;
  for (const bool is_compressed : {false, true}) {
    const std::string how = is_compressed ? "-packed" : "-stored";
    seeds.push_back({"columns" + how,
                     npz_file::archive({{"t_ns.npy", npz_file::column<double>("<f8", {10, 20})},
                                        {"x.npy", npz_file::column<std::uint16_t>("<u2", {1, 2})},
                                        {"y.npy", npz_file::column<std::int32_t>("<i4", {3, 4})},
                                        {"p.npy", npz_file::column<std::uint8_t>("|b1", {0, 1})}},
                                       is_compressed)});
    seeds.push_back({"rows" + how, npz_file::archive({{"arr_0.npy", rows}}, is_compressed)});
  }
  return seeds;
}

inline std::vector<Seed> ecf_seeds() {
  std::vector<Seed> seeds;
  for (const SensorSize size : {SensorSize{2, 3}, {128, 128}, {640, 480}, {2048, 2048}}) {
    for (unsigned seed = 0; seed < 5; ++seed) {
      Bytes chunk;
      encode_ecf(few_events(seed, size, std::size_t{40} * seed), chunk);
      seeds.push_back({std::to_string(size.width) + "-" + std::to_string(seed), chunk});
    }
  }
  return seeds;
}

inline std::vector<Seed> hdf5_seeds() {
  constexpr hsize_t count = 8;
  const std::uint32_t t[count] = {0, 10, 20, 900, 1000, 1100, 3000, 3000};
  const std::uint16_t x[count] = {1, 2, 3, 4, 5, 6, 7, 8};
  const std::uint8_t p[count] = {0, 1, 0, 1, 0, 1, 0, 1};
  const std::uint64_t index[] = {0, 4, 6, 6};
  const std::int64_t offset = 123456;
  std::vector<Seed> seeds;
  for (const int filter : {0, H5Z_FILTER_DEFLATE, H5Z_FILTER_SHUFFLE, H5Z_FILTER_FLETCHER32}) {
    SmallHdf5 file("dsec");
    file.group("events");
    file.packed_dataset("events/t", H5T_NATIVE_UINT32, {count}, t, 4, filter);
    file.packed_dataset("events/x", H5T_NATIVE_UINT16, {count}, x, 4, filter);
    file.dataset("events/y", H5T_NATIVE_UINT16, {count}, x);
    file.dataset("events/p", H5T_NATIVE_UINT8, {count}, p);
    file.dataset("ms_to_idx", H5T_NATIVE_UINT64, {4}, index);
    file.dataset("t_offset", H5T_NATIVE_INT64, {}, &offset);
    seeds.push_back({"dsec-" + std::to_string(filter), file.bytes()});

    const std::uint32_t rows[count][4] = {{0, 1, 2, 0}, {5, 3, 4, 1}};
    SmallHdf5 v2e("v2e");
    v2e.packed_dataset("events", H5T_NATIVE_UINT32, {count, 4}, rows, 4, filter);
    seeds.push_back({"v2e-" + std::to_string(filter), v2e.bytes()});
  }

  const auto event_type = metavision_event_type();
  const auto events = few_events(1, {640, 480}, count);
  Bytes chunk;
  encode_ecf(events, chunk);
  SmallHdf5 file("metavision");
  file.group("CD");
  file.group("EXT_TRIGGER");
  file.stored_dataset("CD/events", event_type.get(), {count}, count, {ecf_filter}, {chunk});
  const Hdf5Handle trigger_type(H5Tcreate(H5T_COMPOUND, 24), H5Tclose);
  H5Tinsert(trigger_type.get(), "p", 0, H5T_NATIVE_INT16);
  H5Tinsert(trigger_type.get(), "t", 8, H5T_NATIVE_INT64);
  H5Tinsert(trigger_type.get(), "id", 16, H5T_NATIVE_INT16);
  const Bytes triggers(std::size_t{24} * 2);
  file.dataset("EXT_TRIGGER/events", trigger_type.get(), {2}, triggers.data());
  write_text_attribute(file.id(), "geometry", "640x480");
  seeds.push_back({"metavision", file.bytes()});
  return seeds;
}

inline Bytes deflated(const Bytes& bytes) {
  Bytes packed(compressBound(bytes.size()));
  auto size = static_cast<uLongf>(packed.size());
  compress(packed.data(), &size, bytes.data(), bytes.size());
  packed.resize(size);
  return packed;
}

/// For chunks of HDF5: layout, filters, and the bytes of a chunk.
inline std::vector<Seed> hdf5_chunk_seeds() {
  auto seeds = ecf_seeds();
  for (auto& seed : seeds) seed.bytes.insert(seed.bytes.begin(), {2, 0, 200, 250, 0});
  for (const std::uint8_t layout : {0, 1, 3}) {
    for (const std::uint8_t filters : {0, 1, 2, 3}) {
      Bytes bytes = {layout, filters, 16, 30, 0};
      Bytes rows(std::size_t{16} * (layout == 0 ? 4 : 16), 1);
      if ((filters & 1) != 0) rows = deflated(rows);
      bytes.insert(bytes.end(), rows.begin(), rows.end());
      seeds.push_back({"other-" + std::to_string(layout) + "-" + std::to_string(filters), bytes});
    }
  }
  return seeds;
}

/// For the filters of HDF5: filters, those that are not applied, and 16 numbers of 4 bytes.
inline std::vector<Seed> hdf5_filters_seeds() {
  const Bytes numbers(64, 1);
  Bytes shuffled = {1, 1, 1, 6, 3};
  shuffled.insert(shuffled.end(), numbers.begin(), numbers.end());
  Bytes packed = {1, 0, 2, 4, 3};
  const auto bytes = deflated(numbers);
  packed.insert(packed.end(), bytes.begin(), bytes.end());
  return {{"empty", {1, 1, 1, 6, 3}}, {"shuffled", shuffled}, {"packed", packed}};
}

}  // namespace fuzz
