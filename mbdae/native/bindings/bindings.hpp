// Arrays between Python and the core.
#pragma once

#include <initializer_list>
#include <string>

#include <nanobind/stl/shared_ptr.h>

#include "bindings/description.hpp"

namespace mbdae {

inline Numbers numbers(const Array& x, size_t n, const char* name) {
  if (x.size() != n)
    refuse(std::string(name) + " has " + std::to_string(x.size()) + " numbers, expected " + std::to_string(n));
  return Numbers(x.data(), x.data() + n);
}

inline nb::object array(const Numbers& x, std::initializer_list<size_t> shape) {
  auto* data = new Numbers(x);
  nb::capsule owner(data, [](void* p) noexcept { delete static_cast<Numbers*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, double>(data->data(), shape, owner));
}

inline nb::object vector(const Numbers& x) { return array(x, {x.size()}); }
inline nb::object maybe(const Numbers& x) { return x.empty() ? nb::none() : vector(x); }

inline nb::object carried(const State& s) { return s.memory ? nb::cast(s.memory) : maybe(s.carry); }

inline State state(const Array& y, const nb::object& carry, const nb::object& low) {
  State s;
  s.y = numbers(y, y.size(), "y");
  const bool stages = nb::isinstance<StageMemory>(carry);
  if (stages) s.memory = nb::cast<std::shared_ptr<StageMemory>>(carry);
  for (auto [from, to] : {std::pair<const nb::object&, Numbers&>(carry, s.carry), {low, s.low}})
    if (!from.is_none() && !(stages && &to == &s.carry)) {
      auto x = nb::cast<Array>(from);
      to.assign(x.data(), x.data() + x.size());
    }
  return s;
}

void bind_limits(nb::module_& m);
void bind_tableau(nb::module_& m);
void bind_radau(nb::module_& m);
void bind_run(nb::module_& m);
void bind_events(nb::module_& m);
void check_events(const Events& events, const Index2System& s);

}  // namespace mbdae
