// SPDX-License-Identifier: LGPL-2.1-or-later
// Recognition of each format, on arbitrary bytes.
#include "src/formats/file_formats.hpp"

#include <string_view>

#include "tests/fuzz/fuzz_decoder.hpp"

namespace {

using namespace fuzz;

Likelihood exact_likelihood(const FileFormat& format, std::span<const std::uint8_t> bytes) {
  Likelihood found = Likelihood::none;
  // In memory of their own, so that sanitizers detect reads past their end.
  in_pieces(bytes, {}, [&](auto all) { found = likelihood(format, all); });
  return found;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span bytes(data, size);
  std::size_t chance = size;
  for (const auto byte : bytes) chance = chance * 31 + byte;
  for (const auto& format : file_formats()) {
    const auto whole = exact_likelihood(format, bytes);
    for (const auto count : {chance % (size + 1), size / 2}) {
      const auto start = exact_likelihood(format, bytes.first(count));
      if (start == Likelihood::none || start == whole) continue;
      require(format.media_type == std::string_view("application/x-event-csv"),
              "what is recognised stays so as bytes are added");
    }
  }
  return 0;
}
