#include "runtime/json.hpp"

#include <cmath>
#include <locale>
#include <sstream>

namespace mbdae {

namespace {

class Parser {
 public:
  explicit Parser(const std::string& text) : at_(text.data()), end_(at_ + text.size()) {
    number_.imbue(std::locale::classic());  // whatever the locale of the program
  }

  Json document() {
    Json out = value();
    skip();
    if (at_ != end_) fail();
    return out;
  }

 private:
  [[noreturn]] static void fail() { reject("the data of the mechanism are damaged"); }
  void skip() {
    while (at_ != end_ && (*at_ == ' ' || *at_ == '\n' || *at_ == '\t' || *at_ == '\r')) ++at_;
  }
  char next() {
    skip();
    if (at_ == end_) fail();
    return *at_;
  }
  bool take(char c) { return next() == c && (++at_, true); }
  void expect(char c) {
    if (!take(c)) fail();
  }
  bool word(const char* text) {
    const std::string expected(text);
    if (static_cast<size_t>(end_ - at_) < expected.size() || expected.compare(0, expected.size(), at_, expected.size()))
      return false;
    at_ += expected.size();
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
      out.kind = Json::Kind::boolean, out.boolean = at_[-2] == 'u';
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

  std::string text() {  // without escapes other than \" and backslashes: names are written so
    std::string out;
    expect('"');
    for (; at_ != end_ && *at_ != '"'; ++at_) {
      if (*at_ == '\\' && ++at_ == end_) fail();
      out += *at_;
    }
    if (at_ == end_) fail();
    ++at_;
    return out;
  }

  double number() {
    if (word("NaN")) return NAN;
    if (word("Infinity")) return INFINITY;
    if (word("-Infinity")) return -INFINITY;
    const char* from = at_;
    while (at_ != end_ && (std::isalnum(static_cast<unsigned char>(*at_)) || *at_ == '-' || *at_ == '+' || *at_ == '.'))
      ++at_;
    double out = 0;
    number_.clear(), number_.str(std::string(from, at_));
    number_ >> out;
    if (number_.fail() && out == 0) fail();
    return out;
  }

  const char *at_, *const end_;
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
  Json* here = this;
  for (size_t k = 0; k < path.size(); ++k) {
    if (here->kind == Kind::table) {
      here = const_cast<Json*>(&here->at(path[k]));
      continue;
    }
    const size_t i = std::stoul(path[k]);
    if (here->kind == Kind::number_list && k + 1 == path.size()) return here->values.at(i);
    here = &here->list.at(i);
  }
  return here->number;
}

Json parse_json(const std::string& text) { return Parser(text).document(); }

}  // namespace mbdae
