// SPDX-License-Identifier: LGPL-2.1-or-later
// Files that gzip or zstd has compressed, and others, which are returned as they are.
#include "src/formats/compressed_file.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

namespace {

using namespace fuzz;
using Bytes = std::vector<std::uint8_t>;

auto content_of(std::span<const std::uint8_t> bytes, Pieces pieces) {
  constexpr std::size_t max_content = std::size_t{1} << 20;
  FileDecompressor decompressor;
  Bytes content;
  const auto add_all = [&] {
    while (content.size() < max_content) {
      const auto part = decompressor.next();
      if (part.empty()) break;
      content.insert(content.end(), part.begin(), part.end());
    }
  };
  in_pieces(bytes, pieces, [&](auto piece) {
    if (content.size() >= max_content) return;
    decompressor.push(piece);
    add_all();
  });
  decompressor.finish();
  add_all();
  const bool is_whole = content.size() < max_content;
  const auto corrupt_at = is_whole ? decompressor.corrupt_at() : std::nullopt;
  require(corrupt_at.value_or(0) <= bytes.size(), "corruption is within the file");
  if (!decompressor.is_compressed())
    require(std::ranges::equal(content, bytes), "other files are the same");
  // libzstd may return more before a corrupt place, the smaller the pieces.
  content.resize(corrupt_at ? 0 : std::min(content.size(), max_content));
  return std::tuple(content, decompressor.is_compressed(), corrupt_at.has_value());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span bytes(data, size);
  require_same_however_cut(bytes, [&](Pieces pieces) { return content_of(bytes, pieces); });
  return 0;
}
