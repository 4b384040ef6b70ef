// Readers of structs from data (Python dicts, JSON), by the lists of their fields (fields.hpp).
#pragma once

#include <algorithm>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "math/fields.hpp"

namespace mbdae {

[[noreturn]] inline void reject(const std::string& text) { throw std::invalid_argument(text); }

// A kind of row, law or signal that Python defines and this core does not: the core is older than the kind.
struct UnknownKind : std::invalid_argument {
  explicit UnknownKind(const std::string& name)
      : std::invalid_argument("kind '" + name + "': it was built before that was written") {}
};

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

template <class T>
using AllFields = std::make_index_sequence<std::tuple_size_v<decltype(std::declval<T&>().fields())>>;

template <class T, class = void>
struct HasFields : std::false_type {};
template <class T>
struct HasFields<T, std::void_t<decltype(T::field_names)>> : std::true_type {};

template <class T>
struct IsSequence : std::false_type {};  // a vector of structs or vectors, not of numbers
template <class T>
struct IsSequence<std::vector<T>> : std::bool_constant<!std::is_arithmetic_v<T>> {};

// Reader of core data: numbers, names of enumerations, arrays of fixed size, sequences, and structs from tables with
// their fields. Data refers to a value; DataAccess reads tables and sequences. Derived classes read further types.
template <class Data>
struct DataAccess;  // contains(d, key), at(d, key), size(d), item(d, i), cast<T>(d)

template <class Derived, class Data>
class Reader {
 public:
  using Access = DataAccess<Data>;

  template <class T>
  T read(Data h) {
    T out{};
    static_cast<Derived*>(this)->read(h, out);
    return out;
  }

  template <class T>
  void read(Data h, T& out) {
    if constexpr (HasFields<T>::value) {
      read_fields(h, out, true);
    } else if constexpr (std::is_enum_v<T>) {
      out = enumerator<T>(Access::template cast<std::string>(h));
    } else if constexpr (std::is_array_v<T>) {
      const auto x = Access::template cast<std::vector<double>>(h);
      if (x.size() != std::extent_v<T>) reject("expected " + std::to_string(std::extent_v<T>) + " numbers");
      std::copy(x.begin(), x.end(), out);
    } else if constexpr (IsSequence<T>::value) {
      for (size_t i = 0, n = Access::size(h); i < n; ++i) out.push_back(read<typename T::value_type>(Access::item(h, i)));
    } else {
      out = Access::template cast<T>(h);
    }
  }
  template <class A, class B>
  void read(Data h, std::pair<A, B>& out) {
    if constexpr (std::is_arithmetic_v<A>) {
      const auto x = Access::template cast<std::vector<A>>(h);
      if (x.size() != 2) reject("a pair must have two items");
      out = {x[0], x[1]};
    } else {
      if (Access::size(h) != 2) reject("a pair must have two items");
      const auto first = Access::item(h, 0), second = Access::item(h, 1);
      static_cast<Derived*>(this)->read(first, out.first), static_cast<Derived*>(this)->read(second, out.second);
    }
  }

  // Unless `all` are required, missing fields keep their values.
  template <class T>
  void read_fields(Data h, T& out, bool all) {
    const auto& names = names_of<T>();
    size_t i = 0;
    auto read_field = [&](auto& field) {
      const char* name = names[i++].c_str();
      if (all || Access::contains(h, name)) static_cast<Derived*>(this)->read(field_of(h, name), field);
    };
    std::apply([&](auto&... field) { (read_field(field), ...); }, out.fields());
  }

 protected:
  static auto field_of(Data h, const char* key) {
    if (!Access::contains(h, key)) reject(std::string("missing key ") + key);
    return Access::at(h, key);
  }
};

template <class Data>
class DataReader : public Reader<DataReader<Data>, Data> {};

}  // namespace mbdae
