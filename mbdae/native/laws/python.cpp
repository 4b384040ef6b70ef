// A Python function (t, q, v, s) -> (tau, s').
#include "../laws.hpp"

namespace mbdae::laws {

namespace {

bool fits(Law& law, const Sizes&) { return static_cast<bool>(law.call); }

void add(const Law& law, const Point& p, const Forces& f) { law.call(p.t, p.q, p.v, p.s, f.other, f.ds); }

}  // namespace

extern const LawKind python{fits, add};

}  // namespace mbdae::laws
