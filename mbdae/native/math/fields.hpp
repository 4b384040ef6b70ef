// The list of the fields of a struct, written once within it, from which its Python attributes, its constructor with
// keywords (bindings/structs.hpp) and its reader (field_reader.hpp) are generated.
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
