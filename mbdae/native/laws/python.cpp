// A Python function (t, q, v, s) -> (tau, s').
#include "../laws.hpp"

namespace mbdae::laws {

static bool fits(Law& law, const Sizes&) { return static_cast<bool>(law.call); }

static void add(const Law& law, const ForcePoint& p, const Forces& f) { law.call(p.t, p.q, p.v, p.s, f.other, f.ds); }

extern const LawKind python{fits, add};

}  // namespace mbdae::laws
