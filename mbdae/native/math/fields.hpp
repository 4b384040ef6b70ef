// The fields of a plain struct, listed once within it: attributes, constructors by keywords, and readers of
// descriptions follow from the list (bindings/structs.hpp).
#pragma once

#include <tuple>

#define FIELDS(...)                                        \
  static constexpr const char* field_names = #__VA_ARGS__; \
  auto fields() { return std::tie(__VA_ARGS__); }

// clang-format off
// An enumeration within a struct, whose values have the same names in Python; kind: enum or enum class.
#define NAMED_ENUM(kind, Name, ...) \
  kind Name { __VA_ARGS__ };        \
  friend constexpr const char* enumerators(Name) { return #__VA_ARGS__; }
// clang-format on
