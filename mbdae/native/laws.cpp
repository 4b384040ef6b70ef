#include "laws.hpp"

#include <map>

namespace mbdae {

namespace laws {

#define LAW(name) extern const LawKind name;
#include "laws.inc"  // LAW(...) for each file of laws/, written by CMake
#undef LAW

}  // namespace laws

const LawKind* law_kind(const std::string& name) {
  static const std::map<std::string, const LawKind*> kinds = {
#define LAW(name) {#name, &laws::name},
#include "laws.inc"
#undef LAW
  };
  auto it = kinds.find(name);
  return it == kinds.end() ? nullptr : it->second;
}

}  // namespace mbdae
