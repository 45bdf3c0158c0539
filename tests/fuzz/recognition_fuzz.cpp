// SPDX-License-Identifier: LGPL-2.1-or-later
// Typefinders on arbitrary bytes.
#include "src/formats/recognition.hpp"

#include "src/formats/text/csv_decoder.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

namespace {

using namespace fuzz;

std::optional<Recognised> recognise_exactly(std::span<const std::uint8_t> bytes) {
  std::optional<Recognised> found;
  // In memory of their own, so that sanitizers detect reads past their end.
  in_pieces(bytes, {}, [&](auto all) { found = recognise(all); });
  return found;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span bytes(data, size);
  const auto whole = recognise_exactly(bytes);
  std::size_t chance = size;
  for (const auto byte : bytes) chance = chance * 31 + byte;
  for (const auto count : {chance % (size + 1), size / 2}) {
    const auto start = recognise_exactly(bytes.first(count));
    if (!start || start == whole) continue;
    require(start->kind == FileKind::csv, "what is recognised stays so as bytes are added");
    require(!whole || !whole->certain, "and text becomes nothing that is certain");
  }
  return 0;
}
