// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

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
  Value value_;
};
