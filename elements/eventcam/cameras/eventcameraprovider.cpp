// SPDX-License-Identifier: LGPL-2.1-or-later
/// Device provider: event cameras that Linux knows as video devices.
#include <fcntl.h>
#include <glob.h>
#include <linux/media.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <cctype>
#include <cstdint>
#include <cstring>
#include <vector>

#include "elements/eventcam/cameras/event_camera.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/properties.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "gst/recording/evt_caps.hpp"

GST_DEBUG_CATEGORY_STATIC(event_camera_provider_debug);
#define GST_CAT_DEFAULT event_camera_provider_debug

using namespace eventcamera;

namespace {

/// An open device; all requests fail if it cannot be opened.
class Device {
 public:
  explicit Device(const std::string& path)
      : descriptor_(open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)) {}
  ~Device() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  template <class Argument>
  bool query(unsigned long request, Argument& argument) const {
    return descriptor_ >= 0 && ioctl(descriptor_, request, &argument) >= 0;
  }

  /// Device number, which the entities of media devices also state.
  std::optional<dev_t> number() const {
    struct stat status {};
    if (descriptor_ < 0 || fstat(descriptor_, &status) != 0) return std::nullopt;
    return status.st_rdev;
  }

 private:
  int descriptor_;
};

std::vector<std::string> paths_of(const char* pattern) {
  glob_t found{};
  std::vector<std::string> paths;
  if (glob(pattern, 0, nullptr, &found) == 0)
    paths.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
  globfree(&found);
  return paths;
}

/// Text of a field, which may lack the zero at its end.
template <class Character, std::size_t size>
std::string text_of(const Character (&field)[size]) {
  const auto* const text = reinterpret_cast<const char*>(field);
  return {text, strnlen(text, size)};
}

std::string fourcc_of(std::uint32_t code) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) text += static_cast<char>(code >> shift & 0xff);
  return text;
}

/// Name of a control as tools write it: "Evt Format" is evt_format.
std::string control_name(std::string text) {
  for (char& character : text) {
    const auto byte = static_cast<unsigned char>(character);
    character = std::isalnum(byte) != 0 ? static_cast<char>(std::tolower(byte)) : '_';
  }
  return text;
}

/// Value of a control: a text, or the name of an item of a menu.
std::string value_of(const Device& device, const v4l2_query_ext_ctrl& control) {
  constexpr std::size_t max_text = 256;
  if (control.type == V4L2_CTRL_TYPE_MENU) {
    v4l2_control item{.id = control.id, .value = 0};
    v4l2_querymenu menu{};
    if (!device.query(VIDIOC_G_CTRL, item)) return {};
    menu.id = control.id;
    menu.index = static_cast<std::uint32_t>(item.value);
    return device.query(VIDIOC_QUERYMENU, menu) ? text_of(menu.name) : std::string();
  }
  if (control.type != V4L2_CTRL_TYPE_STRING || control.elem_size > max_text) return {};
  std::string text(max_text, '\0');
  v4l2_ext_control one{};
  one.id = control.id;
  one.size = max_text;
  one.string = text.data();
  v4l2_ext_controls all{};
  all.which = V4L2_CTRL_WHICH_CUR_VAL;
  all.count = 1;
  all.controls = &one;
  if (!device.query(VIDIOC_G_EXT_CTRLS, all)) return {};
  return text.c_str();  // up to its zero
}

/// Value of the control of this name; empty if there is none.
std::string value_of(const Device& device, const char* name) {
  constexpr std::uint32_t next = V4L2_CTRL_FLAG_NEXT_CTRL;
  v4l2_query_ext_ctrl control{};
  for (control.id = next; device.query(VIDIOC_QUERY_EXT_CTRL, control); control.id |= next)
    if (control_name(text_of(control.name)) == name) return value_of(device, control);
  return {};
}

/// Fills in the media device's sensor, if one of its entities is the video device.
void find_sensor(const Device& media, dev_t video, VideoDevice& found) {
  bool is_of_video = false;
  std::optional<media_entity_desc> sensor;
  media_entity_desc entity{};
  for (entity.id = MEDIA_ENT_ID_FLAG_NEXT; media.query(MEDIA_IOC_ENUM_ENTITIES, entity);
       entity.id |= MEDIA_ENT_ID_FLAG_NEXT) {
    if (entity.type == MEDIA_ENT_F_CAM_SENSOR) sensor = entity;
    is_of_video |= makedev(entity.dev.major, entity.dev.minor) == video;
  }
  if (!is_of_video || !sensor) return;
  found.sensor = text_of(sensor->name);
  const Device node("/dev/char/" + std::to_string(sensor->dev.major) + ":" +
                    std::to_string(sensor->dev.minor));
  found.word_format = value_of(node, "evt_format");
}

std::optional<VideoDevice> described(const Device& video) {
  v4l2_capability capability{};
  if (!video.query(VIDIOC_QUERYCAP, capability)) return std::nullopt;
  const auto capabilities = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                                ? capability.device_caps
                                : capability.capabilities;
  v4l2_format format{};
  if ((capabilities & V4L2_CAP_VIDEO_CAPTURE) != 0)
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  else if ((capabilities & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0)
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
  else
    return std::nullopt;
  if (!video.query(VIDIOC_G_FMT, format)) return std::nullopt;
  // The fields of both types begin alike.
  const auto& buffers = format.fmt.pix;
  return VideoDevice{
      .driver = text_of(capability.driver),
      .card = text_of(capability.card),
      .fourcc = fourcc_of(buffers.pixelformat),
      .buffers = {static_cast<int>(buffers.width), static_cast<int>(buffers.height)}};
}

struct FoundDevice {
  std::string path;
  VideoDevice device;
};

/// The devices of Linux that capture video, /dev/video*.
static std::vector<FoundDevice> find_video_devices() {
  std::vector<FoundDevice> found;
  for (const auto& path : paths_of("/dev/video*")) {
    const Device video(path);
    const auto number = video.number();
    auto device = described(video);
    if (!number || !device) continue;
    for (const auto& media : paths_of("/dev/media*")) find_sensor(Device(media), *number, *device);
    found.push_back({path, *std::move(device)});
  }
  return found;
}

}  // namespace

#define DEVICE_CLASS "EventCamera/Source"

G_DECLARE_FINAL_TYPE(GstEventCameraDevice, gst_event_camera_device, GST, EVENT_CAMERA_DEVICE,
                     GstDevice)

struct _GstEventCameraDevice {
  GstDevice parent;
  gchar* elements;  ///< launch line of a source; null if there is none
};

G_DEFINE_TYPE(GstEventCameraDevice, gst_event_camera_device, GST_TYPE_DEVICE)

static GstElement* create_element(GstDevice* device, const gchar* name) {
  const gchar* const elements = GST_EVENT_CAMERA_DEVICE(device)->elements;
  if (elements == nullptr) {
    GST_WARNING_OBJECT(device, "v4l2src does not read buffers of this format");
    return nullptr;
  }
  GError* error = nullptr;
  GstElement* const bin = gst_parse_bin_from_description_full(elements, TRUE, nullptr,
                                                              GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (bin == nullptr) {
    GST_ERROR_OBJECT(device, "cannot create %s: %s", elements, error->message);
    g_error_free(error);
    return nullptr;
  }
  if (name != nullptr) gst_object_set_name(GST_OBJECT(bin), name);
  return bin;
}

static void gst_event_camera_device_init(GstEventCameraDevice*) {}

static void gst_event_camera_device_class_init(GstEventCameraDeviceClass* klass) {
  G_OBJECT_CLASS(klass)->finalize = +[](GObject* object) {
    g_free(GST_EVENT_CAMERA_DEVICE(object)->elements);
    G_OBJECT_CLASS(gst_event_camera_device_parent_class)->finalize(object);
  };
  GST_DEVICE_CLASS(klass)->create_element = create_element;
}

/// Caps of the words, without fields that the drivers do not report.
static OwnedCaps caps_of(const EventCamera& camera) {
  OwnedCaps caps(gst_caps_from_string(EVT_WORDS_CAPS));
  if (camera.format)
    gst_caps_set_simple(caps.get(), "format", G_TYPE_STRING, evt_format_name(*camera.format),
                        nullptr);
  if (camera.sensor.width > 0)
    gst_caps_set_simple(caps.get(), "width", G_TYPE_INT, camera.sensor.width, "height", G_TYPE_INT,
                        camera.sensor.height, nullptr);
  return caps;
}

/// Launch line of a source for a camera with grey buffers.
static std::string elements_of(const FoundDevice& found, const EventCamera& camera) {
  const auto& buffers = found.device.buffers;
  auto line = "v4l2src name=source device=" + found.path +
              " ! video/x-raw,format=GRAY8,width=" + std::to_string(buffers.width) +
              ",height=" + std::to_string(buffers.height) + " ! evtparse name=parse";
  if (camera.format)
    line += *camera.format == EvtFormat::evt21_legacy
                ? std::string(" format=EVT21-legacy")
                : std::string(" format=") + evt_format_name(*camera.format);
  if (camera.sensor.width > 0)
    line += " width=" + std::to_string(camera.sensor.width) +
            " height=" + std::to_string(camera.sensor.height);
  return line;
}

static GstDevice* device_of(const FoundDevice& found, const EventCamera& camera) {
  GstStructure* const properties = gst_structure_new(
      "event-camera", "device.api", G_TYPE_STRING, "v4l2", "device.path", G_TYPE_STRING,
      found.path.c_str(), "v4l2.device.driver", G_TYPE_STRING, found.device.driver.c_str(),
      "v4l2.device.card", G_TYPE_STRING, found.device.card.c_str(), "sensor", G_TYPE_STRING,
      found.device.sensor.c_str(), nullptr);
  const auto caps = caps_of(camera);
  auto* const device = GST_EVENT_CAMERA_DEVICE(
      g_object_new(gst_event_camera_device_get_type(), "display-name", camera.name.c_str(), "caps",
                   caps.get(), "device-class", DEVICE_CLASS, "properties", properties, nullptr));
  gst_structure_free(properties);
  if (camera.is_grey) device->elements = g_strdup(elements_of(found, camera).c_str());
  return GST_DEVICE(device);
}

G_DECLARE_FINAL_TYPE(GstEventCameraProvider, gst_event_camera_provider, GST, EVENT_CAMERA_PROVIDER,
                     GstDeviceProvider)

struct _GstEventCameraProvider {
  GstDeviceProvider parent;
};

G_DEFINE_TYPE_WITH_CODE(GstEventCameraProvider, gst_event_camera_provider, GST_TYPE_DEVICE_PROVIDER,
                        GST_DEBUG_CATEGORY_INIT(event_camera_provider_debug, "eventcameraprovider",
                                                0, "event cameras among video devices"))
GST_DEVICE_PROVIDER_REGISTER_DEFINE(eventcameraprovider, "eventcameraprovider", GST_RANK_PRIMARY,
                                    gst_event_camera_provider_get_type())

static GList* probe(GstDeviceProvider* provider) {
  GList* devices = nullptr;
  for (const auto& found : find_video_devices()) {
    const auto& device = found.device;
    const auto camera = event_camera_of(device);
    GST_DEBUG_OBJECT(provider, "%s: driver %s, card %s, format %s of %dx%d, sensor %s%s",
                     found.path.c_str(), device.driver.c_str(), device.card.c_str(),
                     device.fourcc.c_str(), device.buffers.width, device.buffers.height,
                     device.sensor.c_str(), camera ? ": an event camera" : "");
    if (camera) devices = g_list_prepend(devices, gst_object_ref_sink(device_of(found, *camera)));
  }
  return g_list_reverse(devices);
}

static void gst_event_camera_provider_init(GstEventCameraProvider*) {}

static void gst_event_camera_provider_class_init(GstEventCameraProviderClass* klass) {
  GstDeviceProviderClass* provider_class = GST_DEVICE_PROVIDER_CLASS(klass);
  provider_class->probe = probe;
  gst_device_provider_class_set_static_metadata(
      provider_class, "Event cameras", DEVICE_CLASS,
      "Lists event cameras among the video devices of Linux", EVENTSIM_AUTHORS);
}
