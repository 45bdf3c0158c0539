// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/named_file.hpp"

#include <glib.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <filesystem>
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

void write_bytes(const std::string& location, std::string_view bytes) {
  std::error_code none;
  const auto status = std::filesystem::symlink_status(location, none);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    const std::unique_ptr<std::FILE, CloseFile> file(std::fopen(location.c_str(), "wb"));
    if (!file || std::fwrite(bytes.data(), 1, bytes.size(), file.get()) != bytes.size() ||
        std::fflush(file.get()) != 0)
      throw std::system_error(errno, std::generic_category());
    return;
  }
  GError* error = nullptr;
  if (g_file_set_contents(location.c_str(), bytes.data(), static_cast<gssize>(bytes.size()),
                          &error))
    return;
  // "Failed to create file NAME: REASON", with the name of a temporary file.
  const std::string message = error->message;
  g_error_free(error);
  const auto colon = message.rfind(": ");
  throw std::runtime_error(colon == message.npos ? message : message.substr(colon + 2));
}
