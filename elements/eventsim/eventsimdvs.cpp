// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventsim-dvs
 * @title: eventsim-dvs
 * @short_description: events of a physical event-camera pixel
 *
 * Turns video into what an event camera would have seen, with the pixel itself simulated: the
 * response to light, the photoreceptor's bandwidth, a reference level that is remembered from frame
 * to frame, thresholds that differ from pixel to pixel, leak, shot noise, hot and dead pixels, the
 * refractory period, latency, and the limits of the readout. Each event has the time at which its
 * pixel's signal crossed its threshold, to the microsecond.
 *
 * A preset says what all of it is; a property that is set, before the preset or after it, says what
 * is different. Thresholds are in units of the response: with log and lin-log a threshold of 0.2 is
 * a change of light by 22 %; linear has as many units from black to white as lin-log, ln(255) =
 * 5.54, so that 0.2 are 9.2 grey levels of 8-bit video.
 *
 * What the sensor of a webcam makes of itself is not light: where a still scene fires, or the dark,
 * denoise keeps its noise away, and its edges where they are.
 *
 * The same video, settings and seed give the same events, whatever the number of threads.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 v4l2src ! eventsim-dvs preset=davis346 ! videoconvert ! autovideosink
 * ]|
 * |[
 * gst-launch-1.0 videotestsrc pattern=ball num-buffers=100 ! eventsim-dvs preset=v2e-noisy
 * threshold-sigma=0.03 seed=7 ! evtenc format=EVT3 ! filesink location=ball.raw
 * ]|
 */
#include <array>
#include <bitset>
#include <mutex>
#include <variant>

#include "gst/base/eventsimulator.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/dvs_simulator.hpp"

using eventcamera::DvsPreset;
using eventcamera::DvsSettings;
using eventcamera::DvsSimulator;
using eventcamera::RefractoryReset;
using eventcamera::Response;
using eventcamera::Upsampling;

namespace {

constexpr guint prop_preset = GST_EVENT_SIMULATOR_FIRST_OWN_PROPERTY;
constexpr guint prop_first_setting = prop_preset + 1;

constexpr DvsPreset default_preset = DvsPreset::ideal;

/// A property that is a setting, and where the settings have it.
struct Setting {
  const char* name;
  const char* nick;
  const char* blurb;
  std::variant<double DvsSettings::*, int DvsSettings::*, bool DvsSettings::*,
               std::uint64_t DvsSettings::*, Response DvsSettings::*, Upsampling DvsSettings::*,
               RefractoryReset DvsSettings::*>
      member;
  double least = 0;
  double most = 0;
};

const Setting table[] = {
    {"denoise", "Denoise",
     "Smooth the frames first, but no difference between neighbours beyond this many grey levels, "
     "white being 255: a frame's noise is not light (0 = off)",
     &DvsSettings::denoise, 0, 255},
    {"linear-light", "Linear light",
     "Undo the transfer function of sRGB (IEC 61966-2-1) first, so that light is what the camera "
     "saw; otherwise luma is taken to be light",
     &DvsSettings::linear_light},
    {"response", "Response", "What the photoreceptor makes of light", &DvsSettings::response},
    {"log-eps", "Offset of the logarithm",
     "response=log is ln(log-eps + light), white being 1: what the darkest pixels see anyway",
     &DvsSettings::log_eps, 1e-6, 1},
    {"upsampling", "Upsampling", "How the light goes from one frame to the next",
     &DvsSettings::upsampling},
    {"max-steps", "Most steps",
     "With upsampling=motion, the most steps between two frames; there are as many as the fastest "
     "thing moves pixels",
     &DvsSettings::max_steps, 1, 255},
    {"cutoff-hz", "Cutoff",
     "Bandwidth of the photoreceptor at white, Hz; darker pixels are slower (0 = no limit)",
     &DvsSettings::cutoff_hz, 0, 1e6},
    {"dark-light", "Dark light",
     "Light that is always there, white being 1: bandwidth goes with "
     "(light + dark-light) / (1 + dark-light), and shot noise falls with it to a quarter",
     &DvsSettings::dark_light, 1e-6, 1},
    {"positive-threshold", "Positive threshold",
     "An ON event needs a rise of this much above the reference (units of the response)",
     &DvsSettings::positive_threshold, 1e-3, 10},
    {"negative-threshold", "Negative threshold",
     "An OFF event needs a fall of this much below the reference (units of the response, a "
     "magnitude)",
     &DvsSettings::negative_threshold, 1e-3, 10},
    {"threshold-sigma", "Threshold mismatch",
     "Standard deviation of each threshold from pixel to pixel (units of the response)",
     &DvsSettings::threshold_sigma, 0, 10},
    {"threshold-jitter", "Threshold jitter",
     "Standard deviation of each threshold from event to event (units of the response)",
     &DvsSettings::threshold_jitter, 0, 10},
    {"leak-rate-hz", "Leak rate",
     "ON events a second of a pixel that sees nothing change, in the mean, Hz: its reference leaks",
     &DvsSettings::leak_rate_hz, 0, 1e4},
    {"leak-spread", "Leak spread",
     "Standard deviation of the leak rate from pixel to pixel, decades", &DvsSettings::leak_spread,
     0, 1},
    {"shot-noise-rate-hz", "Shot-noise rate",
     "Events a second of a pixel that come by chance, ON and OFF together, in the dark, Hz",
     &DvsSettings::shot_noise_rate_hz, 0, 1e4},
    {"hot-pixels", "Hot pixels",
     "Share of the pixels that leak 10 to 1000 ON events a second, whatever they see",
     &DvsSettings::hot_pixels, 0, 1},
    {"dead-pixels", "Dead pixels", "Share of the pixels that never fire", &DvsSettings::dead_pixels,
     0, 1},
    {"refractory-period", "Refractory period",
     "A pixel that has fired does not fire again for so long, microseconds",
     &DvsSettings::refractory_period, 0, 1e6},
    {"refractory-reset", "Refractory reset", "Where the reference of a pixel is after an event",
     &DvsSettings::refractory_reset},
    {"exposure-pulse", "Exposure pulse",
     "Cameras that give frames too couple them into their events: all signals rise by this much "
     "for "
     "a millisecond as an exposure begins (units of the response)",
     &DvsSettings::exposure_pulse, 0, 10},
    {"exposure-lead", "Exposure lead",
     "From the beginning of a frame's exposure to the frame's time, microseconds, up to the time "
     "from frame to frame",
     &DvsSettings::exposure_lead, 0, 1e6},
    {"latency", "Latency",
     "From the crossing of a threshold to the event, microseconds; the refractory period begins "
     "then. What lies behind the last frame is not sent",
     &DvsSettings::latency, 0, 1e6},
    {"latency-jitter", "Latency jitter", "Standard deviation of the latency, microseconds",
     &DvsSettings::latency_jitter, 0, 1e6},
    {"max-event-rate", "Highest event rate",
     "What the readout takes, events a second: others wait, row by row, and a pixel that waits "
     "makes no further event (0 = no limit)",
     &DvsSettings::max_event_rate, 0, 1e12},
    {"seed", "Seed", "Of all that is left to chance: the same gives the same events",
     &DvsSettings::seed},
};
constexpr std::size_t setting_count = std::size(table);

/// What the application has set, copied once per frame.
struct Choice {
  std::mutex mutex;  // guards what follows
  DvsPreset preset = default_preset;
  DvsSettings own;
  std::bitset<setting_count> is_own;
};

struct GstEventSimDvs {
  GstEventSimulator parent;
  Choice* choice;
};

struct GstEventSimDvsClass {
  GstEventSimulatorClass parent_class;
};

}  // namespace

static GType preset_get_type() {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<int>(DvsPreset::ideal), "Neither noise nor delay; lin-log", "ideal"},
        {static_cast<int>(DvsPreset::esim), "ESIM: the same with a logarithm", "esim"},
        {static_cast<int>(DvsPreset::v2e_clean), "v2e, clean: mismatch alone", "v2e-clean"},
        {static_cast<int>(DvsPreset::v2e_noisy), "v2e, noisy: in dim light", "v2e-noisy"},
        {static_cast<int>(DvsPreset::icns), "IEBCS, the simulator of the ICNS", "icns"},
        {static_cast<int>(DvsPreset::davis346), "iniVation DAVIS346", "davis346"},
        {static_cast<int>(DvsPreset::gen4), "Prophesee Gen4, IMX636", "gen4"},
        {0, nullptr, nullptr},
    };
    return g_enum_register_static("GstEventSimDvsPreset", values);
  }();
  return type;
}

static GType response_get_type() {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<int>(Response::log), "ln(log-eps + light)", "log"},
        {static_cast<int>(Response::lin_log), "Linear up to grey level 20, ln(light) above (v2e)",
         "lin-log"},
        {static_cast<int>(Response::linear),
         "ln(255) light: for video whose gamma has made it nearly logarithmic", "linear"},
        {0, nullptr, nullptr},
    };
    return g_enum_register_static("GstEventSimDvsResponse", values);
  }();
  return type;
}

static GType upsampling_get_type() {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<int>(Upsampling::linear),
         "In each pixel on a straight line, in units of the response", "linear"},
        {static_cast<int>(Upsampling::motion),
         "Along dense optical flow, in steps of a pixel at most", "motion"},
        {0, nullptr, nullptr},
    };
    return g_enum_register_static("GstEventSimDvsUpsampling", values);
  }();
  return type;
}

static GType refractory_reset_get_type() {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<int>(RefractoryReset::level),
         "At the level that was crossed; crossings within the refractory period are lost", "level"},
        {static_cast<int>(RefractoryReset::signal), "At the signal as the refractory period ends",
         "signal"},
        {0, nullptr, nullptr},
    };
    return g_enum_register_static("GstEventSimDvsRefractoryReset", values);
  }();
  return type;
}

G_DEFINE_TYPE(GstEventSimDvs, gst_event_sim_dvs, GST_TYPE_EVENT_SIMULATOR)
GST_ELEMENT_REGISTER_DEFINE(eventsim_dvs, "eventsim-dvs", GST_RANK_NONE,
                            gst_event_sim_dvs_get_type())

static Choice& choice_of(void* object) {
  return *G_TYPE_CHECK_INSTANCE_CAST(object, gst_event_sim_dvs_get_type(), GstEventSimDvs)->choice;
}

/// The preset's, where the application has not set its own.
static DvsSettings settings_of(const Choice& choice) {
  DvsSettings settings = eventcamera::settings_of(choice.preset);
  for (std::size_t i = 0; i < setting_count; ++i)
    if (choice.is_own[i])
      std::visit([&](auto member) { settings.*member = choice.own.*member; }, table[i].member);
  return settings;
}

static std::unique_ptr<eventcamera::Simulator> create(GstEventSimulator*,
                                                      const eventcamera::LumaFormat& format) {
  return eventcamera::make_dvs_simulator(format);
}

static void configure(GstEventSimulator* element, eventcamera::Simulator& simulator) {
  auto& choice = choice_of(element);
  const std::lock_guard lock(choice.mutex);
  static_cast<DvsSimulator&>(simulator).set(settings_of(choice));
}

/* a setting's value, its GValue, and its GParamSpec, type by type */

static void read(const GValue* value, double& to) {
  to = g_value_get_double(value);
}
static void read(const GValue* value, int& to) {
  to = static_cast<int>(g_value_get_uint(value));
}
static void read(const GValue* value, bool& to) {
  to = g_value_get_boolean(value) != FALSE;
}
static void read(const GValue* value, std::uint64_t& to) {
  to = g_value_get_uint64(value);
}
template <class Enum>
static void read(const GValue* value, Enum& to) {
  to = static_cast<Enum>(g_value_get_enum(value));
}

static void write(double from, GValue* value) {
  g_value_set_double(value, from);
}
static void write(int from, GValue* value) {
  g_value_set_uint(value, static_cast<guint>(from));
}
static void write(bool from, GValue* value) {
  g_value_set_boolean(value, from ? TRUE : FALSE);
}
static void write(std::uint64_t from, GValue* value) {
  g_value_set_uint64(value, from);
}
template <class Enum>
static void write(Enum from, GValue* value) {
  g_value_set_enum(value, static_cast<int>(from));
}

static constexpr auto property_flags = static_cast<GParamFlags>(
    G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);

static GParamSpec* spec_of(const Setting& s, double preset) {
  return g_param_spec_double(s.name, s.nick, s.blurb, s.least, s.most, preset, property_flags);
}
static GParamSpec* spec_of(const Setting& s, int preset) {
  return g_param_spec_uint(s.name, s.nick, s.blurb, static_cast<guint>(s.least),
                           static_cast<guint>(s.most), static_cast<guint>(preset), property_flags);
}
static GParamSpec* spec_of(const Setting& s, bool preset) {
  return g_param_spec_boolean(s.name, s.nick, s.blurb, preset ? TRUE : FALSE, property_flags);
}
static GParamSpec* spec_of(const Setting& s, std::uint64_t preset) {
  return g_param_spec_uint64(s.name, s.nick, s.blurb, 0, G_MAXUINT64, preset, property_flags);
}
static GParamSpec* spec_of(const Setting& s, Response preset) {
  return g_param_spec_enum(s.name, s.nick, s.blurb, response_get_type(), static_cast<int>(preset),
                           property_flags);
}
static GParamSpec* spec_of(const Setting& s, Upsampling preset) {
  return g_param_spec_enum(s.name, s.nick, s.blurb, upsampling_get_type(), static_cast<int>(preset),
                           property_flags);
}
static GParamSpec* spec_of(const Setting& s, RefractoryReset preset) {
  return g_param_spec_enum(s.name, s.nick, s.blurb, refractory_reset_get_type(),
                           static_cast<int>(preset), property_flags);
}

static bool is_setting(guint id) {
  return id >= prop_first_setting && id < prop_first_setting + setting_count;
}

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  auto& choice = choice_of(object);
  if (id == prop_preset) {
    const std::lock_guard lock(choice.mutex);
    choice.preset = static_cast<DvsPreset>(g_value_get_enum(value));
  } else if (is_setting(id)) {
    const std::size_t i = id - prop_first_setting;
    const std::lock_guard lock(choice.mutex);
    std::visit([&](auto member) { read(value, choice.own.*member); }, table[i].member);
    choice.is_own[i] = true;
  } else {
    gst_event_simulator_set_property(object, id, value, spec);
  }
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  auto& choice = choice_of(object);
  if (id == prop_preset) {
    const std::lock_guard lock(choice.mutex);
    g_value_set_enum(value, static_cast<int>(choice.preset));
  } else if (is_setting(id)) {
    const std::lock_guard lock(choice.mutex);
    const DvsSettings settings = settings_of(choice);
    std::visit([&](auto member) { write(settings.*member, value); },
               table[id - prop_first_setting].member);
  } else {
    gst_event_simulator_get_property(object, id, value, spec);
  }
}

static void finalize(GObject* object) {
  delete &choice_of(object);
  G_OBJECT_CLASS(gst_event_sim_dvs_parent_class)->finalize(object);
}

static void gst_event_sim_dvs_init(GstEventSimDvs* self) {
  self->choice = new Choice();
}

static void gst_event_sim_dvs_class_init(GstEventSimDvsClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->finalize = finalize;
  g_object_class_install_property(
      object_class, prop_preset,
      g_param_spec_enum("preset", "Preset",
                        "What all other properties are that are not set themselves, in any order",
                        preset_get_type(), static_cast<int>(default_preset), property_flags));
  const DvsSettings defaults = eventcamera::settings_of(default_preset);
  for (std::size_t i = 0; i < setting_count; ++i)
    std::visit(
        [&](auto member) {
          g_object_class_install_property(object_class, prop_first_setting + static_cast<guint>(i),
                                          spec_of(table[i], defaults.*member));
        },
        table[i].member);

  GstEventSimulatorClass* simulator_class = GST_EVENT_SIMULATOR_CLASS(klass);
  simulator_class->create = create;
  simulator_class->configure = configure;
  gst_element_class_set_static_metadata(
      GST_ELEMENT_CLASS(klass), "Event camera simulator: physical pixel", "Converter/Video",
      "Turns video into events: simulates the pixels of an event camera and their noise",
      "gst-eventsim");
  gst_type_mark_as_plugin_api(preset_get_type(), static_cast<GstPluginAPIFlags>(0));
  gst_type_mark_as_plugin_api(response_get_type(), static_cast<GstPluginAPIFlags>(0));
  gst_type_mark_as_plugin_api(upsampling_get_type(), static_cast<GstPluginAPIFlags>(0));
  gst_type_mark_as_plugin_api(refractory_reset_get_type(), static_cast<GstPluginAPIFlags>(0));
}
