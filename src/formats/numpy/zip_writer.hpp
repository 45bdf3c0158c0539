// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace eventcamera {

/// Writes a ZIP archive from start to end, without seeking back: the size and the checksum of a
/// file must be known before its content. Files are not compressed; they may exceed 4 GiB (ZIP64).
///
///     archive.begin_file(name, content.size(), crc32(...), out);
///     out.insert(out.end(), content.begin(), content.end());
///     archive.finish(out);
class ZipWriter {
 public:
  /// Appends the header of a file, whose content must follow.
  void begin_file(std::string_view name, std::uint64_t size, std::uint32_t checksum,
                  std::vector<std::uint8_t>& out);

  /// Appends the directory after the content of the last file.
  void finish(std::vector<std::uint8_t>& out) const;

 private:
  struct File {
    std::string name;
    std::uint64_t size;
    std::uint32_t checksum;
    std::uint64_t position;  ///< of its header
  };

  std::vector<File> files_;
  std::uint64_t end_ = 0;  ///< end of the last file
};

}  // namespace eventcamera
