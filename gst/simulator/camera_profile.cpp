// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/camera_profile.hpp"

#include <glib.h>

#include <memory>

#include "gst/base/named_file.hpp"

namespace {

constexpr std::size_t max_size = std::size_t{64} << 10;

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
    return parse_camera_profile(read_bytes(path, max_size), element);
  } catch (const std::runtime_error& reason) {
    throw std::runtime_error("Cannot read the camera profile \"" + path + "\": " + reason.what() +
                             ". Write one with event-calibrate --profile.");
  }
}
