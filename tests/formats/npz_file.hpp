// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes NumPy archives.
#pragma once

#include <zip.h>

#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace npz_file {

using Bytes = std::vector<std::uint8_t>;

using Member = std::pair<std::string, Bytes>;

/// NumPy array of `type`, such as <u2, with this shape.
template <class Number>
Bytes array(const std::string& type, const std::string& shape, const std::vector<Number>& numbers) {
  std::string text = "{'descr': " + type + ", 'fortran_order': False, 'shape': " + shape + ", }";
  text.resize(118 - 1, ' ');
  text += '\n';
  text.insert(0, std::string("\x93NUMPY\x01\0v\0", 10));
  Bytes bytes(text.begin(), text.end());
  const auto* const first = reinterpret_cast<const std::uint8_t*>(numbers.data());
  bytes.insert(bytes.end(), first, first + numbers.size() * sizeof(Number));
  return bytes;
}

template <class Number>
Bytes column(const std::string& type, const std::vector<Number>& numbers) {
  return array("'" + type + "'", "(" + std::to_string(numbers.size()) + ",)", numbers);
}

inline Bytes archive(const std::vector<Member>& members, bool is_compressed) {
  zip_source_t* const out = zip_source_buffer_create(nullptr, 0, 0, nullptr);
  zip_source_keep(out);
  zip_t* const archive = zip_open_from_source(out, ZIP_CREATE | ZIP_TRUNCATE, nullptr);
  for (const auto& [name, bytes] : members) {
    zip_source_t* const in = zip_source_buffer(archive, bytes.data(), bytes.size(), 0);
    const auto index = zip_file_add(archive, name.c_str(), in, 0);
    zip_set_file_compression(archive, static_cast<zip_uint64_t>(index),
                             is_compressed ? ZIP_CM_DEFLATE : ZIP_CM_STORE, 0);
  }
  if (zip_close(archive) != 0) throw std::runtime_error(zip_strerror(archive));
  zip_stat_t stat;
  zip_source_stat(out, &stat);
  Bytes bytes(stat.size);
  zip_source_open(out);
  zip_source_read(out, bytes.data(), bytes.size());
  zip_source_close(out);
  zip_source_free(out);
  return bytes;
}

}  // namespace npz_file
