// A parser of JSON, with NaN and infinities.
#include "runtime/json.hpp"

#include <cmath>
#include <locale>
#include <sstream>

namespace mbdae {

namespace {

class Parser {
 public:
  explicit Parser(const std::string& text) : position_(text.data()), end_(position_ + text.size()) {
    number_.imbue(std::locale::classic());  // independent of the locale of the program
  }

  Json document() {
    Json out = value();
    skip();
    if (position_ != end_) fail();
    return out;
  }

 private:
  [[noreturn]] static void fail() { reject("the data of the mechanism are damaged"); }
  void skip() {
    while (position_ != end_ && (*position_ == ' ' || *position_ == '\n' || *position_ == '\t' || *position_ == '\r'))
      ++position_;
  }
  char next() {
    skip();
    if (position_ == end_) fail();
    return *position_;
  }
  bool take(char c) { return next() == c && (++position_, true); }
  void expect(char c) {
    if (!take(c)) fail();
  }
  bool word(const char* text) {
    const std::string expected(text);
    if (static_cast<size_t>(end_ - position_) < expected.size() ||
        expected.compare(0, expected.size(), position_, expected.size()))
      return false;
    position_ += expected.size();
    return true;
  }

  Json value() {
    Json out;
    const char c = next();
    if (c == '{') return table();
    if (c == '[') return list();
    if (c == '"') {
      out.kind = Json::Kind::text, out.text = text();
    } else if (word("true") || word("false")) {
      out.kind = Json::Kind::boolean, out.boolean = position_[-2] == 'u';
    } else if (!word("null")) {
      out.kind = Json::Kind::number, out.number = number();
    }
    return out;
  }

  Json table() {
    Json out;
    out.kind = Json::Kind::table;
    expect('{');
    while (!take('}')) {
      if (!out.table.empty()) expect(',');
      if (next() != '"') fail();
      std::string key = text();
      expect(':'), out.table.emplace_back(std::move(key), value());
    }
    return out;
  }

  Json list() {
    Json out;
    expect('[');
    bool all_numbers = true;
    while (!take(']')) {
      if (!out.list.empty()) expect(',');
      out.list.push_back(value()), all_numbers = all_numbers && out.list.back().kind == Json::Kind::number;
    }
    out.kind = all_numbers ? Json::Kind::number_list : Json::Kind::list;
    if (!all_numbers) return out;
    for (const Json& x : out.list) out.values.push_back(x.number);
    out.list.clear();
    return out;
  }

  std::string text() {  // the only escapes are \" and \\, as written by the exporter
    std::string out;
    expect('"');
    for (; position_ != end_ && *position_ != '"'; ++position_) {
      if (*position_ == '\\' && ++position_ == end_) fail();
      out += *position_;
    }
    if (position_ == end_) fail();
    ++position_;
    return out;
  }

  double number() {
    if (word("NaN")) return NAN;
    if (word("Infinity")) return INFINITY;
    if (word("-Infinity")) return -INFINITY;
    const char* start = position_;
    while (position_ != end_ && (std::isalnum(static_cast<unsigned char>(*position_)) || *position_ == '-' ||
                                 *position_ == '+' || *position_ == '.'))
      ++position_;
    double out = 0;
    number_.clear(), number_.str(std::string(start, position_));
    number_ >> out;
    if (number_.fail() && out == 0) fail();
    return out;
  }

  const char *position_, *const end_;
  std::istringstream number_;
};

}  // namespace

const Json* Json::find(const std::string& key) const {
  for (const auto& [name, value] : table)
    if (name == key) return &value;
  return nullptr;
}

const Json& Json::at(const std::string& key) const {
  const Json* found = find(key);
  if (!found) reject("missing key " + key);
  return *found;
}

double& Json::number_at(const std::vector<std::string>& path) {
  Json* node = this;
  for (size_t k = 0; k < path.size(); ++k) {
    if (node->kind == Kind::table) {
      node = const_cast<Json*>(&node->at(path[k]));
      continue;
    }
    const size_t i = std::stoul(path[k]);
    if (node->kind == Kind::number_list && k + 1 == path.size()) return node->values.at(i);
    node = &node->list.at(i);
  }
  return node->number;
}

Json parse_json(const std::string& text) { return Parser(text).document(); }

}  // namespace mbdae
