// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <mutex>

/// A value that is accessible only while its lock is held:
///
///     const auto shared = shared_.lock();
///     shared->duration = duration;
///
/// Make no calls while holding the lock.
template <class Value>
class Guarded {
 public:
  using Type = Value;

  class Access {
   public:
    explicit Access(Guarded& guarded) : lock_(guarded.mutex_), value_(guarded.value_) {}
    Value* operator->() const { return &value_; }
    Value& operator*() const { return value_; }

   private:
    std::lock_guard<std::mutex> lock_;
    Value& value_;
  };

  Access lock() { return Access(*this); }

  Value copy() const {
    const std::lock_guard lock(mutex_);
    return value_;
  }

 private:
  mutable std::mutex mutex_;
  Value value_{};
};

/// A value that belongs to the streaming thread of a pad. Each access holds the pad's stream lock,
/// which is recursive: the streaming thread already holds it, and any other thread, such as one
/// that changes the state, waits until that has left the element.
template <class Value>
class StreamLocked {
 public:
  class Access {
   public:
    explicit Access(StreamLocked& locked) : locked_(locked) { GST_PAD_STREAM_LOCK(locked_.pad_); }
    ~Access() { GST_PAD_STREAM_UNLOCK(locked_.pad_); }
    Access(const Access&) = delete;
    Access& operator=(const Access&) = delete;
    Value* operator->() const { return &locked_.value_; }

   private:
    StreamLocked& locked_;
  };

  explicit StreamLocked(GstPad* pad) : pad_(pad) {}

  Access lock() { return Access(*this); }
  Access operator->() { return lock(); }
  void reset() {
    const Access access(*this);
    std::destroy_at(&value_);
    std::construct_at(&value_);
  }

 private:
  GstPad* pad_;
  Value value_{};
};
