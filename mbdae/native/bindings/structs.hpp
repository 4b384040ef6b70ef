// Bindings of structs from the lists of their fields (math/fields.hpp): attributes, constructors with keywords, and
// access to dicts for their readers (math/field_reader.hpp).
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "math/field_reader.hpp"
#include "run/time_loop.hpp"

namespace mbdae {

namespace nb = nanobind;
using Array = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;

inline nb::object item(const nb::dict& d, const char* key) {
  if (!d.contains(key)) reject(std::string("missing key ") + key);
  return d[key];
}

// The argument type of a field: an array of any shape for a vector, a name for the value of an enumeration.
template <class F, class = void>
struct Argument {
  using type = F;
  static F value(F x) { return x; }
};
template <>
struct Argument<Vector> {
  using type = Array;
  static Vector value(const Array& x) { return Vector(x.data(), x.data() + x.size()); }
};
template <class F>
struct Argument<F, std::enable_if_t<std::is_enum_v<F>>> {
  using type = std::string;
  static F value(const std::string& name) { return enumerator<F>(name); }
};

template <class T, size_t... I>
void define_fields(nb::class_<T>& c, bool keywords, void (*complete)(T&), std::index_sequence<I...>) {
  if (keywords)
    c.def(
        "__init__",
        [complete](T* self, typename Argument<Field<T, I>>::type... x) {
          T out{};
          ((std::get<I>(out.fields()) = Argument<Field<T, I>>::value(std::move(x))), ...);
          complete(out);
          new (self) T(std::move(out));
        },
        nb::kw_only(), nb::arg(names_of<T>()[I].c_str())...);
  else
    (c.def_prop_rw(
         names_of<T>()[I].c_str(), [](T& x) -> Field<T, I>& { return std::get<I>(x.fields()); },
         [](T& x, const Field<T, I>& value) { std::get<I>(x.fields()) = value; }),
     ...);
}

// A struct with attributes.
template <class T>
nb::class_<T> bind_attributes(nb::module_& m, const char* name, const char* doc) {
  nb::class_<T> c(m, name, doc);
  define_fields<T>(c, false, nullptr, AllFields<T>());
  return c;
}

// A struct constructed from keywords, all of which are required; `complete` checks it and sets its derived fields.
template <class T>
nb::class_<T> bind_keywords(nb::module_& m, const char* name, const char* doc, void (*complete)(T&) = [](T&) {}) {
  nb::class_<T> c(m, name, doc);
  define_fields<T>(c, true, complete, AllFields<T>());
  return c;
}

// Access to Python values for the readers of structs.
template <>
struct DataAccess<nb::handle> {
  static bool contains(nb::handle h, const char* key) { return nb::cast<nb::dict>(h).contains(key); }
  static nb::object at(nb::handle h, const char* key) { return nb::cast<nb::dict>(h)[key]; }
  static size_t size(nb::handle h) { return nb::len(nb::cast<nb::sequence>(h)); }
  static nb::object item(nb::handle h, size_t i) { return nb::cast<nb::sequence>(h)[i]; }
  template <class T>
  static T cast(nb::handle h) {
    return nb::cast<T>(h);
  }
};

using PyReader = DataReader<nb::handle>;

// A struct as a dict of its fields.
template <class T>
nb::object to_python(T& x) {
  if constexpr (HasFields<T>::value) {
    nb::dict out;
    const auto& names = names_of<T>();
    size_t i = 0;
    std::apply([&](auto&... field) { ((out[names[i++].c_str()] = to_python(field)), ...); }, x.fields());
    return out;
  } else if constexpr (std::is_array_v<T> || IsSequence<T>::value) {
    nb::list out;
    for (auto& item : x) out.append(to_python(item));
    return out;
  } else {
    return nb::cast(x);
  }
}

}  // namespace mbdae
