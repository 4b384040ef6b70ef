// Arrays between Python and the core.
#pragma once

#include <initializer_list>
#include <string>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>

#include "bindings/structs.hpp"

namespace mbdae {

using Out = nb::ndarray<nb::numpy, double>;

inline Vector checked_vector(const Array& x, size_t n, const char* name) {
  if (x.size() != n)
    reject(std::string(name) + " has " + std::to_string(x.size()) + " numbers, expected " + std::to_string(n));
  return Vector(x.data(), x.data() + n);
}

inline Out array(const Vector& x, std::initializer_list<size_t> shape) {
  auto* data = new Vector(x);
  nb::capsule owner(data, [](void* p) noexcept { delete static_cast<Vector*>(p); });
  return Out(data->data(), shape, owner);
}

inline Out vector(const Vector& x) { return array(x, {x.size()}); }
inline std::optional<Out> optional_vector(const Vector& x) {
  return x.empty() ? std::nullopt : std::optional(vector(x));
}

// The carry of a method from step to step: an array, the stages of the last step, or None.
inline nb::object carry_of(const State& s) {
  return s.memory ? nb::cast(s.memory) : nb::cast(optional_vector(s.carry));
}

inline State state(const Array& y, const nb::object& carry, const std::optional<Array>& low = {}) {
  State s;
  s.y = checked_vector(y, y.size(), "y");
  if (low) s.low = checked_vector(*low, low->size(), "low");
  if (nb::isinstance<StageMemory>(carry)) {
    s.memory = nb::cast<std::shared_ptr<StageMemory>>(carry);
  } else if (!carry.is_none()) {
    const auto x = nb::cast<Array>(carry);
    s.carry = checked_vector(x, x.size(), "carry");
  }
  return s;
}

void bind_structs(nb::module_& m);
void bind_events(nb::module_& m);
void bind_run(nb::module_& m);
void check_events(const Events& events, const Index2System& s);

}  // namespace mbdae
