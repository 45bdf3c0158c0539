// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/named_file.hpp"

#include <array>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <system_error>

namespace {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

}  // namespace

std::string read_bytes(const std::string& location, std::size_t max_size) {
  const std::unique_ptr<std::FILE, CloseFile> file(std::fopen(location.c_str(), "rb"));
  if (!file) throw std::system_error(errno, std::generic_category());
  std::string bytes;
  std::array<char, 1 << 16> chunk;
  while (const std::size_t size = std::fread(chunk.data(), 1, chunk.size(), file.get())) {
    bytes.append(chunk.data(), size);
    if (bytes.size() > max_size)
      throw std::runtime_error("it is larger than " + std::to_string(max_size >> 10) + " KiB");
  }
  if (std::ferror(file.get()) != 0) throw std::system_error(errno, std::generic_category());
  return bytes;
}
