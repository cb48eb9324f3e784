#pragma once
#include <memory>

namespace texmesh {

/// A value that few owners have: it takes a pointer until somebody is about to change it. Copies are of the
/// value.
template <class T>
class Seldom {
 public:
  Seldom() = default;
  Seldom(const Seldom& other) : value_(other.value_ ? std::make_unique<T>(*other.value_) : nullptr) {}
  Seldom(Seldom&&) noexcept = default;
  Seldom& operator=(Seldom other) noexcept { return value_.swap(other.value_), *this; }

  const T& operator*() const {
    static const T none;
    return value_ ? *value_ : none;
  }
  const T* operator->() const { return &**this; }
  /// Makes the value.
  T* operator->() {
    if (!value_) value_ = std::make_unique<T>();
    return value_.get();
  }

 private:
  std::unique_ptr<T> value_;
};

}  // namespace texmesh
