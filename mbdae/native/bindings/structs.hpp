// Plain structs in Python, by the lists of their fields (math/fields.hpp): attributes, constructors by keywords, and
// readers of dicts.
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

#include "run/time_loop.hpp"

namespace mbdae {

namespace nb = nanobind;
using Array = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;

[[noreturn]] inline void reject(const std::string& text) { throw std::invalid_argument(text); }

// A kind of row, law or signal that Python has and this core does not: the core was built before it was written.
struct UnknownKind : std::invalid_argument {
  explicit UnknownKind(const std::string& name)
      : std::invalid_argument("kind '" + name + "': it was built before that was written") {}
};

inline nb::object item(const nb::dict& d, const char* key) {
  if (!d.contains(key)) reject(std::string("missing key ") + key);
  return d[key];
}

inline std::vector<std::string> split_names(const std::string& list) {
  std::vector<std::string> out(1);
  for (char c : list)
    if (c == ',')
      out.emplace_back();
    else if (c != ' ')
      out.back() += c;
  return out;
}

template <class T>
const std::vector<std::string>& names_of() {
  static const std::vector<std::string> all = split_names(T::field_names);
  return all;
}

template <class E>
E enumerator(const std::string& name) {
  static const std::vector<std::string> all = split_names(enumerators(E{}));
  for (size_t i = 0; i < all.size(); ++i)
    if (all[i] == name) return static_cast<E>(i);
  throw UnknownKind(name);
}

template <class T, size_t I>
using Field = std::remove_reference_t<std::tuple_element_t<I, decltype(std::declval<T&>().fields())>>;

// The argument for a field: arrays of any shape for numbers, names for values of enumerations.
template <class F, class = void>
struct Argument {
  using type = F;
  static F value(F x) { return x; }
};
template <>
struct Argument<Numbers> {
  using type = Array;
  static Numbers value(const Array& x) { return Numbers(x.data(), x.data() + x.size()); }
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
          T made{};
          ((std::get<I>(made.fields()) = Argument<Field<T, I>>::value(std::move(x))), ...);
          complete(made);
          new (self) T(std::move(made));
        },
        nb::kw_only(), nb::arg(names_of<T>()[I].c_str())...);
  else
    (c.def_prop_rw(
         names_of<T>()[I].c_str(), [](T& x) -> Field<T, I>& { return std::get<I>(x.fields()); },
         [](T& x, const Field<T, I>& value) { std::get<I>(x.fields()) = value; }),
     ...);
}

template <class T>
using AllFields = std::make_index_sequence<std::tuple_size_v<decltype(std::declval<T&>().fields())>>;

// A struct with attributes.
template <class T>
nb::class_<T> bind_attributes(nb::module_& m, const char* name, const char* doc) {
  nb::class_<T> c(m, name, doc);
  define_fields<T>(c, false, nullptr, AllFields<T>());
  return c;
}

// A struct that is made from keywords, all of which are required; `complete` checks it and sets what follows from them.
template <class T>
nb::class_<T> bind_keywords(nb::module_& m, const char* name, const char* doc, void (*complete)(T&) = [](T&) {}) {
  nb::class_<T> c(m, name, doc);
  define_fields<T>(c, true, complete, AllFields<T>());
  return c;
}

template <class T, class = void>
struct HasFields : std::false_type {};
template <class T>
struct HasFields<T, std::void_t<decltype(T::field_names)>> : std::true_type {};

template <class T>
struct IsSequence : std::false_type {};  // of anything but numbers
template <class T>
struct IsSequence<std::vector<T>> : std::bool_constant<!std::is_arithmetic_v<T>> {};

// Reads core data: numbers, names of enumerations, arrays of a fixed size, sequences, and structs from dicts with their
// fields. A derived class reads what needs more than that.
template <class Derived>
class Reader {
 public:
  template <class T>
  T read(nb::handle h) {
    T out{};
    static_cast<Derived*>(this)->read(h, out);
    return out;
  }

  template <class T>
  void read(nb::handle h, T& out) {
    if constexpr (HasFields<T>::value) {
      read_fields(h, out, true);
    } else if constexpr (std::is_enum_v<T>) {
      out = enumerator<T>(nb::cast<std::string>(h));
    } else if constexpr (std::is_array_v<T>) {
      const auto x = nb::cast<Numbers>(h);
      if (x.size() != std::extent_v<T>) reject("expected " + std::to_string(std::extent_v<T>) + " numbers");
      std::copy(x.begin(), x.end(), out);
    } else if constexpr (IsSequence<T>::value) {
      for (nb::handle x : nb::cast<nb::sequence>(h)) out.push_back(read<typename T::value_type>(x));
    } else {
      out = nb::cast<T>(h);
    }
  }
  template <class A, class B>
  void read(nb::handle h, std::pair<A, B>& out) {
    const auto x = nb::cast<nb::sequence>(h);
    if (nb::len(x) != 2) reject("a pair has two items");
    static_cast<Derived*>(this)->read(x[0], out.first), static_cast<Derived*>(this)->read(x[1], out.second);
  }

  // Fields that may be missing keep their values.
  template <class T>
  void read_fields(nb::handle h, T& out, bool all) {
    const auto d = nb::cast<nb::dict>(h);
    const auto& names = names_of<T>();
    size_t i = 0;
    auto one = [&](auto& field) {
      const char* name = names[i++].c_str();
      if (all || d.contains(name)) static_cast<Derived*>(this)->read(item(d, name), field);
    };
    std::apply([&](auto&... field) { (one(field), ...); }, out.fields());
  }
};

class DataReader : public Reader<DataReader> {};

}  // namespace mbdae
