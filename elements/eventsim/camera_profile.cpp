// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventsim/camera_profile.hpp"

#include <glib.h>

#include <cerrno>
#include <fstream>
#include <memory>
#include <stdexcept>

namespace {

constexpr std::size_t max_size = std::size_t{64} << 10;

/// Throws std::runtime_error with the reason.
std::string text_of(const std::string& path) {
  std::string text(max_size + 1, '\0');
  std::ifstream file(path, std::ios::binary);
  if (!file.read(text.data(), static_cast<std::streamsize>(text.size())) && !file.eof())
    throw std::runtime_error(g_strerror(errno));
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.size() > max_size) throw std::runtime_error("it is larger than 64 KiB");
  return text;
}

struct Free {
  void operator()(GKeyFile* file) const { g_key_file_unref(file); }
  void operator()(GError* error) const { g_error_free(error); }
  void operator()(gchar* text) const { g_free(text); }
  void operator()(gchar** texts) const { g_strfreev(texts); }
};

}  // namespace

ProfileEntries parse_camera_profile(const std::string& text, const char* element) {
  const std::unique_ptr<GKeyFile, Free> file(g_key_file_new());
  GError* error = nullptr;
  if (!g_key_file_load_from_data(file.get(), text.c_str(), text.size(), G_KEY_FILE_NONE, &error))
    throw std::runtime_error(std::unique_ptr<GError, Free>(error)->message);
  const std::unique_ptr<gchar*, Free> keys(
      g_key_file_get_keys(file.get(), element, nullptr, nullptr));
  if (!keys) throw std::runtime_error(std::string("it has no group [") + element + "]");
  ProfileEntries entries;
  for (gchar** key = keys.get(); *key != nullptr; ++key) {
    const std::unique_ptr<gchar, Free> value(
        g_key_file_get_string(file.get(), element, *key, nullptr));
    entries.emplace_back(*key, value ? value.get() : "");
  }
  return entries;
}

ProfileEntries read_camera_profile(const std::string& path, const char* element) {
  try {
    return parse_camera_profile(text_of(path), element);
  } catch (const std::runtime_error& reason) {
    throw std::runtime_error("Cannot read the camera profile \"" + path + "\": " + reason.what() +
                             ". Write one with event-calibrate --profile.");
  }
}
