// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <exception>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>

/// Reads a file of at most `max_size` bytes, a multiple of 1024. Throws std::runtime_error with the
/// reason if it cannot be read or is larger.
std::string read_bytes(const std::string& location, std::size_t max_size);

/// Writes a file, a regular one atomically. Follows links, and writes to devices. Throws
/// std::runtime_error with the reason.
void write_bytes(const std::string& location, std::string_view bytes);

/// Returns parse(bytes) of the file `location`. Exceptions become a std::runtime_error that names
/// `what`, the file and the reason.
template <class Parse>
auto read_named_file(const std::string& what, const std::string& location, std::size_t max_size,
                     const Parse& parse) {
  try {
    return parse(read_bytes(location, max_size));
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    throw std::runtime_error("cannot read " + what + " \"" + location + "\": " + error.what());
  }
}
