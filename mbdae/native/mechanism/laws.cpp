#include "mechanism/laws.hpp"

#include <map>

namespace mbdae {

namespace laws {

#define LAW(name) extern const LawKind name;
#include "laws.inc"  // LAW(...) for each file of laws/, written by CMake
#undef LAW

}  // namespace laws

void LawPartials::add(const PairPartials& here, const WrenchPartials& t, bool conservative_) const {
  double* to = conservative_ ? conservative : other;
  here.torque(t, to, width);
  if (t.damped) here.damping(t.C, to + here.nv, width);
  if (wrenches) wrenches->push_back({&here.pair, t, conservative_});
}

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
