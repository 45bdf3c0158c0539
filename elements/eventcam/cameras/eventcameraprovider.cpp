// SPDX-License-Identifier: LGPL-2.1-or-later
/// Device provider: event cameras that Linux knows as video devices.
#include <gst/gst.h>

#include <string>

#include "elements/eventcam/cameras/video_devices.hpp"
#include "gst/base/authors.hpp"
#include "gst/base/owned.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "gst/recording/evt_caps.hpp"

GST_DEBUG_CATEGORY_STATIC(event_camera_provider_debug);
#define GST_CAT_DEFAULT event_camera_provider_debug

using eventcamera::EventCamera;

#define DEVICE_CLASS "EventCamera/Source"

/* devices */

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
    line += *camera.format == eventcamera::EvtFormat::evt21_legacy
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

/* provider */

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
