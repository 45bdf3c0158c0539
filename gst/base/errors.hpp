// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <concepts>
#include <exception>
#include <new>
#include <string>
#include <type_traits>
#include <utility>

/// Error and warning messages of elements. A message has two parts: a text for the user (what
/// failed, on what, what to do), and the cause for debugging (call, errno, caps, exception text).

/// Domain and code of a message, from any of GStreamer's error enums.
struct ErrorCode {
  ErrorCode(GstCoreError error) : domain(GST_CORE_ERROR), code(error) {}
  ErrorCode(GstLibraryError error) : domain(GST_LIBRARY_ERROR), code(error) {}
  ErrorCode(GstResourceError error) : domain(GST_RESOURCE_ERROR), code(error) {}
  ErrorCode(GstStreamError error) : domain(GST_STREAM_ERROR), code(error) {}

  GQuark domain;
  int code;
};

/// Call site of a function with this default argument. Replaces std::source_location, which clang
/// 14 lacks.
struct CallSite {
  explicit CallSite(const char* file_ = __builtin_FILE(),
                    const char* function_ = __builtin_FUNCTION(), int line_ = __builtin_LINE())
      : file(file_), function(function_), line(line_) {}

  const char* file;
  const char* function;
  int line;
};

/// User-visible part of a message.
struct Report {
  ErrorCode code;
  std::string text;
};

/// Records the last error of an element. False if it is the same as before, without a state change
/// in between: a refused sticky event is sent again before each following buffer and event.
inline bool record_error(GstElement* element, const std::string& text) {
  static const GQuark quark = g_quark_from_static_string("event-last-error");
  GST_OBJECT_LOCK(element);
  const auto error = std::to_string(element->state_cookie) + ": " + text;
  const auto* const last = static_cast<const gchar*>(g_object_get_qdata(G_OBJECT(element), quark));
  const bool repeats = last != nullptr && last == error;
  if (!repeats) g_object_set_qdata_full(G_OBJECT(element), quark, g_strdup(error.c_str()), g_free);
  GST_OBJECT_UNLOCK(element);
  return !repeats;
}

/// Like GST_ELEMENT_ERROR and GST_ELEMENT_WARNING, with code and text as values. A repeated error
/// is posted once. Invalid UTF-8, such as quoted bytes of a file, becomes U+FFFD.
inline void post_message(gpointer element, GstMessageType type, const Report& report,
                         const std::string& cause, CallSite at = CallSite()) {
  if (type == GST_MESSAGE_ERROR && !record_error(GST_ELEMENT(element), report.text)) return;
  gst_element_message_full(GST_ELEMENT(element), type, report.code.domain, report.code.code,
                           g_utf8_make_valid(report.text.c_str(), -1),
                           g_utf8_make_valid(cause.c_str(), -1), at.file, at.function, at.line);
}

/// Log level of a condition that tends to repeat: WARNING the first time, then LOG.
class RepeatLevel {
 public:
  GstDebugLevel next() { return std::exchange(repeats_, true) ? GST_LEVEL_LOG : GST_LEVEL_WARNING; }

  void reset() { repeats_ = false; }

 private:
  bool repeats_ = false;
};

/// Posts a warning only the first time, and logs it every time. For conditions that tend to repeat.
class WarnOnce {
 public:
  explicit WarnOnce(GstDebugCategory* category) : category_(category) {}

  void operator()(gpointer element, const Report& report, const std::string& cause,
                  CallSite at = CallSite()) {
    const GstDebugLevel level = level_.next();
    gst_debug_log(category_, level, at.file, at.function, at.line, G_OBJECT(element), "%s (%s)",
                  report.text.c_str(), cause.c_str());
    if (level == GST_LEVEL_WARNING) post_message(element, GST_MESSAGE_WARNING, report, cause, at);
  }

  void reset() { level_.reset(); }

 private:
  GstDebugCategory* category_;
  RepeatLevel level_;
};

/// Runs `work` in a function called by GStreamer, which exceptions must not leave. An exception is
/// posted as an error message of `element`, with `report`, a Report or a function that makes one
/// from the exception. The result is then GST_FLOW_ERROR, false or nullptr. If `work` returns void,
/// the result is true on success.
template <class MakeReport, std::invocable Work>
auto catch_exceptions(gpointer element, const MakeReport& report, const Work& work,
                      CallSite at = CallSite()) {
  using Result = std::invoke_result_t<const Work&>;
  try {
    if constexpr (std::is_void_v<Result>) {
      work();
      return true;
    } else {
      return work();
    }
  } catch (const std::exception& error) {
    if constexpr (std::is_invocable_v<const MakeReport&, const std::exception&>)
      post_message(element, GST_MESSAGE_ERROR, report(error), error.what(), at);
    else
      post_message(element, GST_MESSAGE_ERROR, report, error.what(), at);
  }
  if constexpr (std::same_as<Result, GstFlowReturn>)
    return GST_FLOW_ERROR;
  else if constexpr (std::is_void_v<Result>)
    return false;
  else
    return Result{};
}

/// True if an exception is of this type.
template <class Exception>
bool is_a(const std::exception& error) {
  return dynamic_cast<const Exception*>(&error) != nullptr;
}

/// For catch_exceptions(): reports an exception while an element processes events; `verb` is, for
/// example, "count".
inline auto events_report(const char* verb) {
  return [verb](const std::exception& error) -> Report {
    if (is_a<std::bad_alloc>(error))
      return {GST_RESOURCE_ERROR_NO_SPACE_LEFT,
              std::string("Not enough memory to ") + verb +
                  " these events; free memory, or lower the resolution."};
    return {GST_STREAM_ERROR_FAILED, std::string("Cannot ") + verb + " these events."};
  };
}
