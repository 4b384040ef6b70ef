// Description of a mechanism from Python (mbdae/mechanism/formulations/core_description.py), read and checked.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "run/time_loop.hpp"

namespace mbdae {

namespace nb = nanobind;
using Array = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Active = nb::ndarray<const std::uint8_t, nb::c_contig, nb::device::cpu>;
using Headings = nb::ndarray<double, nb::c_contig, nb::device::cpu>;

[[noreturn]] inline void refuse(const std::string& text) { throw std::invalid_argument(text); }

// A kind of row, law or signal that Python has and this core does not: the core was built before it was written.
struct UnknownKind : std::invalid_argument {
  explicit UnknownKind(const std::string& name)
      : std::invalid_argument("kind '" + name + "': it was built before that was written") {}
};

// Python references of a core: functions, which the garbage collector must see, as they may lead back to the core; and
// whether one of them was interrupted.
struct Callbacks {
  std::vector<nb::object> functions;
  bool interrupted = false;

  PyObject* add(const nb::dict& d, const char* key = "call") {  // borrowed: lives as long as the core
    if (!d.contains(key)) refuse(std::string("missing key ") + key);
    functions.push_back(nb::borrow(d[key]));
    return functions.back().ptr();
  }
};

template <class T>
T get(const nb::dict& d, const char* key) {
  if (!d.contains(key)) refuse(std::string("missing key ") + key);
  return nb::cast<T>(d[key]);
}

template <class K>
K kind(const std::map<std::string, K>& known, const std::string& name) {
  auto it = known.find(name);
  if (it == known.end()) throw UnknownKind(name);
  return it->second;
}

inline void within(const std::vector<int>& x, int n, const char* what) {
  for (int i : x)
    if (i < 0 || i >= n) refuse(std::string(what) + " out of range");
}

TimeFunction signal(const nb::dict& d, Callbacks& callbacks);
std::vector<std::pair<Anchor, Anchor>> pairs(const nb::list& list, int joints);
Row row(const nb::dict& d, const Sizes& n, int pair_count, Callbacks& callbacks);
// Call Python with arrays, for arrays of these sizes, or a number: see `Callbacks`.
void call_python(nb::handle f, bool* interrupted, const std::vector<std::pair<const double*, size_t>>& in,
                 const std::vector<Numbers*>& out);
Driver driver(const nb::dict& d, size_t row_count, Callbacks& callbacks);
SampledController sampler(const nb::dict& d, const Sizes& n, int ns, Callbacks& callbacks);
FrictionInterface sliding_place(const nb::dict& d, const Constraints& constraints);
Law law(const nb::dict& d, const Sizes& n, int ns, int pair_count, int& pair, Callbacks& callbacks);

}  // namespace mbdae
