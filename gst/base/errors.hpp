// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <concepts>
#include <exception>
#include <string>
#include <type_traits>
#include <utility>

/// How elements report errors and warnings. A report has two parts: a text for the user (what
/// failed, on what, what to do) and the cause for whoever debugs it (call, errno, caps, the text of
/// an exception).

/// The domain and code of a message: any of GStreamer's error enumerations.
struct ErrorCode {
  ErrorCode(GstCoreError error) : domain(GST_CORE_ERROR), code(error) {}
  ErrorCode(GstLibraryError error) : domain(GST_LIBRARY_ERROR), code(error) {}
  ErrorCode(GstResourceError error) : domain(GST_RESOURCE_ERROR), code(error) {}
  ErrorCode(GstStreamError error) : domain(GST_STREAM_ERROR), code(error) {}

  GQuark domain;
  int code;
};

/// Where a function with this default argument is called: std::source_location, which clang 14 does
/// not have.
struct CallSite {
  explicit CallSite(const char* file_ = __builtin_FILE(),
                    const char* function_ = __builtin_FUNCTION(), int line_ = __builtin_LINE())
      : file(file_), function(function_), line(line_) {}

  const char* file;
  const char* function;
  int line;
};

/// What the user is told.
struct Report {
  ErrorCode code;
  std::string text;
};

/// As GST_ELEMENT_ERROR and GST_ELEMENT_WARNING, where code and text are values.
inline void post_message(gpointer element, GstMessageType type, const Report& report,
                         const std::string& cause, CallSite at = CallSite()) {
  gst_element_message_full(GST_ELEMENT(element), type, report.code.domain, report.code.code,
                           g_strdup(report.text.c_str()), g_strdup(cause.c_str()), at.file,
                           at.function, at.line);
}

/// A warning that is posted once, because what it warns of tends to repeat. Each is logged.
class WarnOnce {
 public:
  void operator()(gpointer element, const Report& report, const std::string& cause,
                  CallSite at = CallSite()) {
    if (std::exchange(posted_, true))
      GST_CAT_WARNING_OBJECT(GST_CAT_DEFAULT, element, "%s (%s)", report.text.c_str(),
                             cause.c_str());
    else
      post_message(element, GST_MESSAGE_WARNING, report, cause, at);
  }

  /// For a new stream: the next warning is posted again.
  void reset() { posted_ = false; }

 private:
  bool posted_ = false;
};

/// Runs `work`, which may throw, where an exception must not pass: in a function that GStreamer
/// calls. An exception becomes an error message of `element`; `report` tells what the message says:
/// a Report, or a function that makes one of the exception. The result is then GST_FLOW_ERROR, or
/// false, or nullptr. Work without a result gives true when it is done.
template <class MakeReport, std::invocable Work>
auto guarded(gpointer element, const MakeReport& report, const Work& work,
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

/// Whether an exception is of this type.
template <class Exception>
bool is_a(const std::exception& error) {
  return dynamic_cast<const Exception*>(&error) != nullptr;
}
