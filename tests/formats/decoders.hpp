// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/aedat/aedat2_decoder.hpp"
#include "src/formats/aedat/aedat3_decoder.hpp"
#include "src/formats/aedat/aedat4_decoder.hpp"
#include "src/formats/aedat/aedat_decoder.hpp"
#include "src/formats/hdf5/hdf5_reader.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/ros/bag_decoder.hpp"
#include "src/formats/text/csv_decoder.hpp"
#include "src/formats/text/csv_encoder.hpp"

namespace eventcamera {

inline std::unique_ptr<EventDecoder> make_aedat2_decoder(
    SensorSize size = {}, Aedat2Version version = Aedat2Version::two) {
  return std::make_unique<Aedat2Decoder>(size, version);
}
inline std::unique_ptr<EventDecoder> make_aedat3_decoder() {
  return std::make_unique<Aedat3Decoder>();
}
inline std::unique_ptr<Decoder> make_aedat4_decoder() {
  return std::make_unique<Aedat4Decoder>();
}
inline std::unique_ptr<Decoder> make_aedat_decoder() {
  return std::make_unique<AedatDecoder>();
}
inline std::unique_ptr<Decoder> make_bag_decoder(const std::string& topics) {
  return std::make_unique<BagDecoder>(topics);
}
inline std::unique_ptr<EventDecoder> make_npy_decoder(const TableSettings& settings = {}) {
  return std::make_unique<NpyDecoder>(settings);
}
inline std::unique_ptr<EventDecoder> make_csv_decoder(const TableSettings& settings = {}) {
  return std::make_unique<CsvDecoder>(settings);
}
inline std::unique_ptr<Encoder> make_csv_encoder(const CsvFormat& format, SensorSize size) {
  return std::make_unique<CsvEncoder>(format, size);
}

struct Aedat4HeaderOf {
  std::size_t packets_at;
  std::optional<std::uint64_t> table_at;
  Aedat4Compression compression;
};

inline std::optional<Aedat4HeaderOf> read_aedat4_header(std::span<const std::uint8_t> bytes) {
  Aedat4Decoder decoder;
  decoder.push(bytes);
  while (decoder.next()) continue;
  return Aedat4HeaderOf{decoder.packets_at(), decoder.table_at(), decoder.compression()};
}

}  // namespace eventcamera
