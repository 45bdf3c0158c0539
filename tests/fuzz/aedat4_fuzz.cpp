// SPDX-License-Identifier: LGPL-2.1-or-later
// AEDAT4, through the reader for all AEDAT versions, and its packet table.
#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_decoder.hpp"
#include "src/formats/aedat/aedat_decoder.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"
#include "tests/fuzz/item_sums.hpp"

namespace {

using namespace fuzz;

/// Seeks to the last events according to the table, or back to the start.
void seek(AedatDecoder& reader, std::span<const std::uint8_t> bytes) {
  Aedat4Decoder decoder;
  decoder.push(bytes);
  decoder.next();
  auto position = decoder.packets_at();
  if (decoder.table_at() && *decoder.table_at() < bytes.size()) {
    const auto at = static_cast<std::size_t>(*decoder.table_at());
    const auto table =
        read_aedat4_table(bytes.subspan(at), decoder.compression(), decoder.packets_at());
    if (table && !table->empty())
      position = aedat4_position_of(*table, table->back().end).value_or(position);
  }
  reader.restart({.position = position});
  if (position < bytes.size()) reader.push(bytes.subspan(static_cast<std::size_t>(position)));
  Sums sums;
  take(reader, sums);
  reader.drain();
  take(reader, sums);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span bytes(data, size);
  require_same_however_cut(bytes, [&](Pieces pieces) {
    AedatDecoder reader;
    const auto sums = sums_of(reader, bytes, pieces);
    const bool is_read = !reader.streams().empty() && reader.format_name() == "AEDAT 4.0";
    if (is_read && pieces.max_size == 0) seek(reader, bytes);
    return sums;
  });
  return 0;
}
