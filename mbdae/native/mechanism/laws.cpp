// The table of force laws, from the files of laws/.
#include "mechanism/laws.hpp"

#include <map>

namespace mbdae {

namespace laws {

#define LAW(name) extern const LawKind name;
#include "laws.inc"  // LAW(...) for each file of laws/, written by CMake
#undef LAW

}  // namespace laws

void LawPartials::add(const PairPartials& pair_partials, const WrenchPartials& t, bool conservative_) const {
  double* tau_partials = conservative_ ? conservative : other;
  pair_partials.generalized_force(t, tau_partials, width);
  if (t.damped) pair_partials.damping(t.C, tau_partials + pair_partials.nv, width);
  if (wrenches) wrenches->push_back({&pair_partials.pair, t, conservative_});
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
