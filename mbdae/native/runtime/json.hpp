// JSON data, and access to them for readers of structs.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "math/field_reader.hpp"

namespace mbdae {

struct Json {
  enum class Kind { null, boolean, number, text, number_list, list, table } kind = Kind::null;
  bool boolean = false;
  double number = 0;
  std::string text;
  std::vector<double> values;  // numbers of a list that contains nothing else
  std::vector<Json> list;
  std::vector<std::pair<std::string, Json>> table;

  const Json* find(const std::string& key) const;   // in a table; nullptr: missing
  const Json& at(const std::string& key) const;     // std::invalid_argument: missing key
  double& number_at(const std::vector<std::string>& path);  // path: keys of tables and indices of lists
};

Json parse_json(const std::string& text);  // std::invalid_argument: invalid JSON

template <>
struct DataAccess<const Json*> {
  static bool contains(const Json* d, const char* key) { return d->find(key); }
  static const Json* at(const Json* d, const char* key) { return d->find(key); }
  static size_t size(const Json* d) {
    if (d->kind != Json::Kind::list && !(d->kind == Json::Kind::number_list && d->values.empty())) reject("expected a list");
    return d->list.size();
  }
  static const Json* item(const Json* d, size_t i) { return &d->list[i]; }
  template <class T>
  static T cast(const Json* d) {
    using Kind = Json::Kind;
    if constexpr (std::is_same_v<T, bool>) {
      return require(d, Kind::boolean).boolean;
    } else if constexpr (std::is_arithmetic_v<T>) {
      return static_cast<T>(require(d, Kind::number).number);
    } else if constexpr (std::is_same_v<T, std::string>) {
      return require(d, Kind::text).text;
    } else {  // a list of numbers
      const auto& x = require(d, Kind::number_list).values;
      return T(x.begin(), x.end());
    }
  }

 private:
  static const Json& require(const Json* d, Json::Kind kind) {
    if (d->kind != kind) reject("a value of another kind was expected");
    return *d;
  }
};

}  // namespace mbdae
