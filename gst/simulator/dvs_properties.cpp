// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/dvs_properties.hpp"

#include <bitset>
#include <cstdint>
#include <iterator>
#include <variant>

#include "gst/base/element_type.hpp"
#include "gst/base/properties.hpp"
#include "gst/simulator/camera_profile.hpp"
#include "gst/simulator/eventsimulator.hpp"

using eventcamera::DvsPreset;
using eventcamera::DvsSettings;
using eventcamera::Nanoseconds;
using eventcamera::RefractoryReset;
using eventcamera::Response;
using eventcamera::Upsampling;

static GType response_type() {
  return enum_type<Response>(
      "GstEventSimDvsResponse",
      {
          {Response::log, "ln(log-eps + light)", "log"},
          {Response::lin_log, "Linear up to grey level 20, ln(light) above (v2e)", "lin-log"},
          {Response::linear, "ln(255) light: for video that is nearly logarithmic due to its gamma",
           "linear"},
      });
}

static GType upsampling_type() {
  return enum_type<Upsampling>(
      "GstEventSimDvsUpsampling",
      {
          {Upsampling::linear, "Linear interpolation per pixel, in units of the response",
           "linear"},
          {Upsampling::motion,
           "Motion along dense optical flow, in steps of a pixel, or more if it is fast", "motion"},
      });
}

static GType refractory_reset_type() {
  return enum_type<RefractoryReset>(
      "GstEventSimDvsRefractoryReset",
      {
          {RefractoryReset::level,
           "The level that was crossed; crossings within the refractory period are lost", "level"},
          {RefractoryReset::signal, "The signal at the end of the refractory period", "signal"},
      });
}

static GType preset_type() {
  return enum_type<DvsPreset>(
      "GstEventSimDvsPreset",
      {
          {DvsPreset::standard,
           "A typical event camera: logarithmic, with motion between frames, for any frame camera",
           "standard"},
          {DvsPreset::ideal, "No noise, no delay; lin-log", "ideal"},
          {DvsPreset::esim, "ESIM: like ideal, with a logarithmic response", "esim"},
          {DvsPreset::v2e_clean, "v2e, clean: threshold mismatch only", "v2e-clean"},
          {DvsPreset::v2e_noisy, "v2e, noisy: dim light", "v2e-noisy"},
          {DvsPreset::icns, "IEBCS, the simulator of the ICNS", "icns"},
          {DvsPreset::davis240c, "iniVation DAVIS240C, fitted to a recording", "davis240c"},
          {DvsPreset::davis346, "iniVation DAVIS346, fitted to a recording", "davis346"},
          {DvsPreset::gen4, "Prophesee Gen4, IMX636; thresholds are a guess", "gen4"},
          {DvsPreset::hs_ergb, "Event camera of TimeLens' HS-ERGB, fitted to a recording",
           "hs-ergb"},
      });
}

namespace {

constexpr double max_time = GST_SECOND;

/// A property stored in a member of DvsSettings.
struct PixelProperty {
  const char* name;
  const char* blurb;
  std::variant<double DvsSettings::*, int DvsSettings::*, bool DvsSettings::*,
               std::uint64_t DvsSettings::*, Nanoseconds DvsSettings::*, Response DvsSettings::*,
               Upsampling DvsSettings::*, RefractoryReset DvsSettings::*>
      member;
  double min = 0;
  double max = 0;
  GParamFlags flags = mutable_playing_flags;
  GType (*type)() = nullptr;  ///< for enums
};

const PixelProperty pixel_properties[] = {
    {"denoise", denoise_blurb, &DvsSettings::denoise, -1, 255, controllable_flags},
    {"linear-light",
     "Invert the sRGB transfer function (IEC 61966-2-1) first, to recover the light that reached "
     "the camera; otherwise luma is used as light",
     &DvsSettings::linear_light},
    {"exposure-compensation",
     "Divide out changes of the frame camera's automatic exposure, which an event camera does not "
     "see: gains of 1 % to 25 % from one frame to the next (share of the light) that three "
     "quarters of the image agree on. A lamp that lights all of it evenly and gradually looks the "
     "same, and does not fire",
     &DvsSettings::exposure_compensation},
    {"response", "Response of the photoreceptor to light", &DvsSettings::response, 0, 0,
     mutable_playing_flags, response_type},
    {"log-eps",
     "Light that response=log adds before the logarithm, which limits the response to dark pixels "
     "(white is 1)",
     &DvsSettings::log_eps, 1e-6, 1},
    {"overexposed-light",
     "Light of pixels that are white in the frame, which does not show how bright they are (white "
     "is 1). Light rises to it over the 20 of 255 grey levels below white",
     &DvsSettings::overexposed_light, 1, 1000},
    {"upsampling", "Model of light between two frames", &DvsSettings::upsampling, 0, 0,
     mutable_playing_flags, upsampling_type},
    {"max-interpolated-frames",
     "Maximum number of frames interpolated between two frames with upsampling=motion. Without "
     "this limit, steps are a pixel for motion of up to 4 pixels, and longer for more",
     &DvsSettings::max_interpolated_frames, 0, 254},
    {"exposure-time",
     "Exposure of the frames (ns); 0: short or unknown. The motion blur of long exposures is "
     "removed along the optical flow with upsampling=motion, where the timestamp of a frame must "
     "be the middle of its exposure. Short exposures are more realistic with 0",
     &DvsSettings::exposure_time, 0, max_time, controllable_flags},
    {"cutoff-frequency",
     "Bandwidth of the photoreceptor at white; darker pixels are slower (Hz; 0 = no limit)",
     &DvsSettings::cutoff_frequency, 0, 1e6, controllable_flags},
    {"dark-light",
     "Background illuminance, which limits how slow and noisy dark pixels get (fraction of white): "
     "the bandwidth of a pixel is cutoff-frequency times its brightness, (light + dark-light) / (1 "
     "+ dark-light), and its shot noise falls from all of shot-noise-rate at brightness 0 to a "
     "quarter at 1",
     &DvsSettings::dark_light, 1e-6, 1, controllable_flags},
    {"positive-threshold",
     "Contrast threshold of ON events: rise above the reference level (units of the response)",
     &DvsSettings::positive_threshold, 1e-3, 10, controllable_flags},
    {"negative-threshold",
     "Contrast threshold of OFF events: fall below the reference level (units of the response, a "
     "magnitude)",
     &DvsSettings::negative_threshold, 1e-3, 10, controllable_flags},
    {"threshold-sigma",
     "Standard deviation of the contrast thresholds between pixels (units of the response)",
     &DvsSettings::threshold_sigma, 0, 10},
    {"threshold-jitter",
     "Standard deviation of the contrast thresholds between events (units of the response)",
     &DvsSettings::threshold_jitter, 0, 10, controllable_flags},
    {"leak-rate",
     "Mean rate of ON events of a pixel in constant light, due to the leak of its reference level "
     "(Hz)",
     &DvsSettings::leak_rate, 0, 1e4, controllable_flags},
    {"leak-spread", "Standard deviation of the leak rate between pixels (decades)",
     &DvsSettings::leak_spread, 0, 1},
    {"shot-noise-rate", "Rate of noise events of a dark pixel, ON plus OFF (Hz)",
     &DvsSettings::shot_noise_rate, 0, 1e4, controllable_flags},
    {"hot-pixels",
     "Fraction of pixels whose leak fires 10 to 1000 ON events per second, regardless of light",
     &DvsSettings::hot_pixels, 0, 1},
    {"dead-pixels", "Fraction of pixels that never fire", &DvsSettings::dead_pixels, 0, 1},
    {"adaptation",
     "Growth of a pixel's contrast thresholds by each of its events, as a fraction of them; pixels "
     "of real cameras saturate in this way at strong edges",
     &DvsSettings::adaptation, 0, 10, controllable_flags},
    {"adaptation-time",
     "Time in which the growth by one event decays to 0, at a constant rate (ns)",
     &DvsSettings::adaptation_time, 1000, max_time, controllable_flags},
    {"refractory-period", "Time after an event during which the pixel cannot fire (ns)",
     &DvsSettings::refractory_period, 0, max_time, controllable_flags},
    {"refractory-reset", "Reference level of a pixel after an event",
     &DvsSettings::refractory_reset, 0, 0, mutable_playing_flags, refractory_reset_type},
    {"exposure-pulse",
     "Rise of all signals for a millisecond when an exposure begins, in cameras that also capture "
     "frames (units of the response)",
     &DvsSettings::exposure_pulse, 0, 10, controllable_flags},
    {"exposure-lead",
     "Time from the start of a frame's exposure, where exposure-pulse begins, to the frame's "
     "timestamp (ns). At least 100000 is assumed; there is no pulse if it is longer than the time "
     "between frames",
     &DvsSettings::exposure_lead, 0, max_time, controllable_flags},
    {"pixel-latency",
     "Time from the threshold crossing to the event, when the refractory period begins (ns). "
     "Events after the last frame are not sent",
     &DvsSettings::pixel_latency, 0, max_time, controllable_flags},
    {"pixel-latency-jitter", "Standard deviation of pixel-latency (ns)",
     &DvsSettings::pixel_latency_jitter, 0, max_time, controllable_flags},
    {"max-rate",
     "Capacity of the readout: further events wait, row by row, and a waiting pixel cannot fire "
     "again (events/s; 0 = no limit)",
     &DvsSettings::max_rate, 0, 1e12, controllable_flags},
    {"seed", "Seed of all random numbers: the same seed gives the same events", &DvsSettings::seed},
};

/// Settings that come from one source.
struct Overrides {
  DvsSettings settings;
  std::bitset<std::size(pixel_properties)> is_set;

  void set(std::size_t i, const GValue* value) {
    std::visit([&](auto member) { read_value(value, settings.*member); },
               pixel_properties[i].member);
    is_set[i] = true;
  }
  void override(DvsSettings& others) const {
    for (std::size_t i = 0; i < is_set.size(); ++i)
      if (is_set[i])
        std::visit([&](auto member) { others.*member = settings.*member; },
                   pixel_properties[i].member);
  }
};

std::runtime_error error_in(const std::string& profile, const std::string& setting,
                            const std::string& fault) {
  return std::runtime_error("The camera profile \"" + profile + "\" sets " + setting + fault);
}

/// Takes a setting from text. Returns false if it has no such value.
bool set_from_text(Overrides& overrides, const PixelProperty& property, const std::string& text,
                   GObjectClass* klass) {
  GParamSpec* spec = g_object_class_find_property(klass, property.name);
  GValue value = G_VALUE_INIT;
  g_value_init(&value, spec->value_type);
  const bool is_valid = !text.empty() && gst_value_deserialize(&value, text.c_str()) != FALSE &&
                        g_param_value_validate(spec, &value) == FALSE;
  if (is_valid) overrides.set(static_cast<std::size_t>(&property - pixel_properties), &value);
  g_value_unset(&value);
  return is_valid;
}

/// Reads the settings in a camera profile. Throws std::runtime_error.
Overrides read_profile(const std::string& path, GObjectClass* klass) {
  Overrides overrides;
  for (const auto& [name, text] : read_camera_profile(path, "eventsim-dvs")) {
    const auto* property = std::ranges::find(pixel_properties, name, &PixelProperty::name);
    if (property == std::end(pixel_properties))
      throw error_in(path, name, ", which eventsim-dvs does not have.");
    if (!set_from_text(overrides, *property, text, klass))
      throw error_in(path, name,
                     " to a value that it cannot have; see gst-inspect-1.0 eventsim-dvs.");
  }
  return overrides;
}

struct Settings {
  DvsPreset preset = DvsPreset::standard;
  std::string profile;
  Overrides of_profile;       ///< override the preset
  std::string profile_error;  ///< reason why the profile could not be read; empty if it was
  Overrides of_properties;    ///< override both

  DvsSettings dvs_settings() const {
    auto settings = eventcamera::settings_of(preset);
    of_profile.override(settings);
    of_properties.override(settings);
    return settings;
  }

  void set_profile(const GValue* value, GObjectClass* klass) {
    read_value(value, profile);
    of_profile = {};
    profile_error = {};
    if (profile.empty()) return;
    try {
      of_profile = read_profile(profile, klass);
    } catch (const std::runtime_error& error) {
      profile_error = error.what();
    }
  }
};

}  // namespace

static Guarded<Settings>& settings_of(GObject* object) {
  return event_simulator_settings<Settings>(object);
}

template <class Value>
static GParamSpec* spec_of(const PixelProperty& row, const Value& value) {
  if constexpr (std::is_enum_v<Value>)
    return new_spec(row.name, row.blurb, value, row.flags, row.type());
  else if constexpr (std::is_same_v<Value, std::uint64_t>)
    return new_spec(row.name, row.blurb, value, row.flags, 0, G_MAXUINT64);
  else
    return new_spec(row.name, row.blurb, value, row.flags, row.min, row.max);
}

void install_dvs_properties(GObjectClass* klass) {
  Properties<settings_of> properties(klass);
  properties.add(
      &Settings::preset, "preset",
      "Camera model: sets all properties of the pixel that are not set explicitly, before or after",
      preset_type());
  properties.add(
      [klass](Settings& settings, const GValue* value) { settings.set_profile(value, klass); },
      [](Settings& settings, GValue* value) { write_value(settings.profile, value); },
      new_spec("profile",
               "File of settings that event-calibrate fitted to a camera. They override the "
               "preset, but not properties that are set explicitly, before or after",
               std::string(), mutable_ready_flags));
  const DvsSettings defaults = Settings().dvs_settings();
  for (std::size_t i = 0; i < std::size(pixel_properties); ++i) {
    const auto add = [&](auto member) {
      properties.add(
          [i](Settings& settings, const GValue* value) { settings.of_properties.set(i, value); },
          [member](Settings& settings, GValue* value) {
            write_value(settings.dvs_settings().*member, value);
          },
          spec_of(pixel_properties[i], defaults.*member));
    };
    std::visit(add, pixel_properties[i].member);
  }
}

std::shared_ptr<void> make_dvs_settings() {
  return std::make_shared<Guarded<Settings>>();
}

DvsSettings dvs_settings_of(GObject* object) {
  return settings_of(object).copy().dvs_settings();
}

std::string fault_of_profile(GObject* object) {
  return settings_of(object).copy().profile_error;
}
