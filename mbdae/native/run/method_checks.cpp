// Checks of tableaus, collocation coefficients, compositions and generalized-alpha parameters.
#include "run/method_checks.hpp"

#include <cmath>

#include "math/field_reader.hpp"
#include "math/vec3.hpp"

namespace mbdae {

namespace {

void check_finite(std::initializer_list<const Vector*> all) {
  for (const Vector* x : all)
    if (!finite(x->data(), static_cast<int>(x->size()))) reject("the coefficients of a method must be finite");
}

// The number of rows of error weights, each with a weight per stage.
int error_rows(const Vector& weights, size_t stages, size_t min_rows) {
  if (!stages || weights.size() % stages || weights.size() / stages < min_rows || weights.size() / stages > 2)
    reject("error weights must have one or two rows with a weight for each stage");
  return static_cast<int>(weights.size() / stages);
}

}  // namespace

void complete_tableau(Tableau& t) {
  const size_t n = t.b.size();
  t.n = static_cast<int>(n), t.errors = error_rows(t.error_weights, n, 0);
  if (t.A.size() != n * n || t.Ahat.size() != n * n || t.c.size() != n || t.chat.size() != n)
    reject("a tableau must have a row, a column and a node for each stage");
  check_finite({&t.A, &t.Ahat, &t.b, &t.c, &t.chat, &t.error_weights});
  for (size_t i = 0; i < n; ++i)
    for (size_t j = i; j < n; ++j)
      if (t.A[i * n + j] != 0 || (j > i && t.Ahat[i * n + j] != 0))
        reject("A must be strictly lower triangular, Ahat lower triangular");
  for (size_t i = t.explicit_first; i < n; ++i)
    if (t.Ahat[i * n + i] == 0) reject("the diagonal of Ahat must not vanish");
  if (!(t.noise >= 0) || !std::isfinite(t.noise)) reject("noise must be finite and not negative");
  if (t.doubling_order < 0) reject("the order of doubled steps must not be negative");
}

void complete_radau(Radau& r) {
  const size_t s = r.c.size();
  r.s = static_cast<int>(s), r.errors = error_rows(r.start, s, 1);
  if (r.A.size() != s * s) reject("A must have a row and a column for each stage");
  for (const EigenMode& m : r.modes)
    if (m.column.size() != s || m.row.size() != s) reject("the vectors of a mode must have an entry for each stage");
  if (r.real < -1 || r.real >= static_cast<int>(r.modes.size()) || r.middle < 0 || r.middle >= r.s)
    reject("index of the real mode or of the middle stage out of range");
  check_finite({&r.c, &r.A, &r.start});
}

void complete_composition(Composition& c) {
  if (c.weights.empty() || c.nodes.size() != c.weights.size() + 1)
    reject("a composition must have one more node than weights");
  check_finite({&c.weights, &c.nodes});
}

void complete_alpha(GeneralizedAlpha& a) {
  if (!(a.alpha_m < 1) || !(a.alpha_f < 1) || !(a.beta > 0) || !(a.gamma > 0))
    reject("alpha_m and alpha_f must be less than 1, beta and gamma positive");
}

}  // namespace mbdae
