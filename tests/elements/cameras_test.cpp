// SPDX-License-Identifier: LGPL-2.1-or-later
// The device provider, with devices of Linux that the test plays itself: the plugin's calls to
// open() and ioctl() end here. What they say is that of the documentation of drivers; no camera.
#include <dlfcn.h>
#include <fcntl.h>
#include <glob.h>
#include <linux/media.h>
#include <linux/videodev2.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <cstdarg>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tests/elements/harness.hpp"

namespace {

using harness::Owned;

constexpr unsigned video_major = 81;

struct Video {
  const char* driver;
  const char* card;
  std::uint32_t fourcc;
  unsigned width;
  unsigned height;
};

constexpr auto grey = V4L2_PIX_FMT_GREY;

/// A GenX320 at a Raspberry Pi 5, a KV260, and a webcam; by minor number.
const std::map<unsigned, Video> videos = {
    {7, {"rp1-cfe", "rp1-cfe", grey, 4096, 391}},
    {8, {"psee-dma", "ps_host_if output 0", v4l2_fourcc('P', 'S', 'E', '3'), 1280, 720}},
    {9, {"uvcvideo", "a webcam", V4L2_PIX_FMT_YUYV, 640, 480}},
};
constexpr unsigned sensor_minor = 20;

enum class Kind { video, media, sensor };

struct Open {
  Kind kind;
  unsigned minor;
};

/// Descriptors of the played devices that are open; the plugin probes in one thread.
std::map<int, Open> open_devices;

template <class Function>
Function* next(const char* name, Function* /*type*/) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

template <std::size_t size>
void put(unsigned char (&field)[size], const char* text) {
  g_strlcpy(reinterpret_cast<char*>(field), text, size);
}

int answer_of_video(const Video& video, unsigned long request, void* argument) {
  if (request == VIDIOC_QUERYCAP) {
    auto& capability = *static_cast<v4l2_capability*>(argument);
    put(capability.driver, video.driver);
    put(capability.card, video.card);
    capability.capabilities = V4L2_CAP_DEVICE_CAPS;
    capability.device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
    return 0;
  }
  if (request != VIDIOC_G_FMT) return -1;
  auto& pixels = static_cast<v4l2_format*>(argument)->fmt.pix;
  pixels.width = video.width;
  pixels.height = video.height;
  pixels.pixelformat = video.fourcc;
  return 0;
}

/// The media device of the Raspberry Pi: its video device, and its sensor.
int answer_of_media(unsigned long request, void* argument) {
  if (request != MEDIA_IOC_ENUM_ENTITIES) return -1;
  auto& entity = *static_cast<media_entity_desc*>(argument);
  const auto last = entity.id & ~MEDIA_ENT_ID_FLAG_NEXT;
  if (last > 1) return -1;
  entity = {};
  entity.id = last + 1;
  entity.dev.major = video_major;
  if (last == 0) {
    entity.type = MEDIA_ENT_F_IO_V4L;
    entity.dev.minor = 7;
    g_strlcpy(entity.name, "rp1-cfe-csi2_ch0", sizeof entity.name);
  } else {
    entity.type = MEDIA_ENT_F_CAM_SENSOR;
    entity.dev.minor = sensor_minor;
    g_strlcpy(entity.name, "genx320 10-003c", sizeof entity.name);
  }
  return 0;
}

int answer_of_sensor(unsigned long request, void* argument) {
  constexpr std::uint32_t first = V4L2_CID_USER_BASE;
  if (request == VIDIOC_QUERY_EXT_CTRL) {
    auto& control = *static_cast<v4l2_query_ext_ctrl*>(argument);
    const auto last = control.id & ~V4L2_CTRL_FLAG_NEXT_CTRL;
    if (last > first) return -1;
    control.id = last < first ? first : first + 1;
    control.type = control.id == first ? V4L2_CTRL_TYPE_INTEGER : V4L2_CTRL_TYPE_STRING;
    control.elem_size = 8;
    g_strlcpy(control.name, control.id == first ? "Bias" : "Evt Format", sizeof control.name);
    return 0;
  }
  if (request != VIDIOC_G_EXT_CTRLS) return -1;
  const auto& one = *static_cast<v4l2_ext_controls*>(argument)->controls;
  if (one.id != first + 1) return -1;
  g_strlcpy(one.string, "EVT21", one.size);
  return 0;
}

std::optional<Open> played(std::string_view path) {
  for (const auto& [minor, video] : videos)
    if (path == "/dev/video" + std::to_string(minor)) return Open{Kind::video, minor};
  if (path == "/dev/media3") return Open{Kind::media, 0};
  if (path == "/dev/char/81:20") return Open{Kind::sensor, sensor_minor};
  return std::nullopt;
}

}  // namespace

#define PLAYED extern "C" __attribute__((visibility("default")))

PLAYED int glob(const char* pattern, int flags, int (*error)(const char*, int), glob_t* found) {
  static std::string paths[] = {"/dev/video7", "/dev/video8", "/dev/video9", "/dev/media3"};
  static char* videos_found[] = {paths[0].data(), paths[1].data(), paths[2].data(), nullptr};
  static char* media_found[] = {paths[3].data(), nullptr};
  const bool is_video = std::string_view(pattern) == "/dev/video*";
  if (!is_video && std::string_view(pattern) != "/dev/media*")
    return next("glob", glob)(pattern, flags, error, found);
  found->gl_pathv = is_video ? videos_found : media_found;
  found->gl_pathc = is_video ? 3 : 1;
  return 0;
}

PLAYED void globfree(glob_t* found) {
  const std::string_view first = found->gl_pathc > 0 ? found->gl_pathv[0] : "";
  if (!played(first)) next("globfree", globfree)(found);
}

PLAYED int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const auto mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  const auto device = played(path);
  const int descriptor = next("open", open)(device ? "/dev/zero" : path, flags, mode);
  if (device) open_devices[descriptor] = *device;
  return descriptor;
}

PLAYED int close(int descriptor) {
  if (!open_devices.empty()) open_devices.erase(descriptor);
  return next("close", close)(descriptor);
}

PLAYED int fstat(int descriptor, struct stat* status) noexcept {
  const int result = next("fstat", fstat)(descriptor, status);
  const auto device = open_devices.find(descriptor);
  if (device != open_devices.end()) status->st_rdev = makedev(video_major, device->second.minor);
  return result;
}

PLAYED int ioctl(int descriptor, unsigned long request, ...) noexcept {
  va_list rest;
  va_start(rest, request);
  void* const argument = va_arg(rest, void*);
  va_end(rest);
  const auto device = open_devices.find(descriptor);
  if (device == open_devices.end()) return next("ioctl", ioctl)(descriptor, request, argument);
  switch (device->second.kind) {
    case Kind::video:
      return answer_of_video(videos.at(device->second.minor), request, argument);
    case Kind::media:
      return answer_of_media(request, argument);
    case Kind::sensor:
      return answer_of_sensor(request, argument);
  }
  return -1;
}

namespace {

struct UnrefDevice {
  void operator()(GstDevice* device) const { gst_object_unref(device); }
};
using Device = std::unique_ptr<GstDevice, UnrefDevice>;

std::vector<Device> devices_of(GList* list) {
  std::vector<Device> devices;
  for (const GList* item = list; item != nullptr; item = item->next)
    devices.emplace_back(GST_DEVICE(item->data));
  g_list_free(list);
  return devices;
}

class EventCameras : public testing::Test {
 protected:
  static void SetUpTestSuite() { gst_init(nullptr, nullptr); }

  std::vector<Device> found() const {
    GstDeviceProvider* const provider =
        gst_device_provider_factory_get_by_name("eventcameraprovider");
    EXPECT_NE(provider, nullptr);
    auto devices = devices_of(gst_device_provider_get_devices(provider));
    gst_object_unref(provider);
    EXPECT_TRUE(open_devices.empty()) << "left open";
    return devices;
  }

  static std::string name_of(const Device& device) {
    gchar* const text = gst_device_get_display_name(device.get());
    std::string name = text;
    g_free(text);
    return name;
  }

  static void expect_caps(const Device& device, const char* text) {
    const Owned<GstCaps> caps(gst_device_get_caps(device.get()));
    const Owned<GstCaps> expected(gst_caps_from_string(text));
    EXPECT_TRUE(gst_caps_is_equal(caps.get(), expected.get())) << text;
  }

  template <class Value>
  static Value property(GstElement* bin, const char* element, const char* name) {
    const Owned<GstElement> child(gst_bin_get_by_name(GST_BIN(bin), element));
    Value value{};
    g_object_get(child.get(), name, &value, nullptr);
    return value;
  }
};

TEST_F(EventCameras, AreListed) {
  const auto devices = found();
  ASSERT_EQ(devices.size(), 2U);
  EXPECT_EQ(name_of(devices[0]), "Event camera genx320");
  EXPECT_EQ(name_of(devices[1]), "Event camera ps_host_if output 0");
  expect_caps(devices[0], "application/x-event-camera,format=EVT21,width=320,height=320");
  expect_caps(devices[1], "application/x-event-camera,format=EVT3,width=1280,height=720");
  for (const auto& device : devices)
    EXPECT_TRUE(gst_device_has_classes(device.get(), "EventCamera/Source"));
  GstStructure* const properties = gst_device_get_properties(devices[0].get());
  EXPECT_STREQ(gst_structure_get_string(properties, "device.path"), "/dev/video7");
  EXPECT_STREQ(gst_structure_get_string(properties, "sensor"), "genx320 10-003c");
  gst_structure_free(properties);
}

TEST_F(EventCameras, CreateWhatReadsThem) {
  GstElementFactory* const source = gst_element_factory_find("v4l2src");
  if (source == nullptr) GTEST_SKIP() << "no v4l2src";
  gst_object_unref(source);
  const auto devices = found();
  GstElement* const created = gst_device_create_element(devices.at(0).get(), "camera");
  ASSERT_NE(created, nullptr);
  const Owned<GstElement> bin(GST_ELEMENT(gst_object_ref_sink(created)));
  EXPECT_STREQ(GST_OBJECT_NAME(bin.get()), "camera");
  gchar* const path = property<gchar*>(bin.get(), "source", "device");
  EXPECT_STREQ(path, "/dev/video7");
  g_free(path);
  EXPECT_EQ(property<guint>(bin.get(), "parse", "width"), 320U);
  EXPECT_EQ(property<guint>(bin.get(), "parse", "height"), 320U);
  GstPad* const pad = gst_element_get_static_pad(bin.get(), "src");
  ASSERT_NE(pad, nullptr);
  gst_object_unref(pad);
  EXPECT_EQ(gst_device_create_element(devices.at(1).get(), nullptr), nullptr)
      << "v4l2src has no such format";
}

}  // namespace
