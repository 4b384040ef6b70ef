// Enumeration of the states of all multipliers, for a unique solution.
#include "run/complementarity.hpp"

#include <algorithm>

namespace mbdae {

namespace {

// A problem scaled so that the diagonal of W is 1.
class Problem {
 public:
  Problem(const Vector& W, const Vector& c, const Vector& noise, const std::vector<Multiplier>& multipliers,
          const Tolerances& tolerances)
      : tolerances_(tolerances),
        n_(multipliers.size()),
        W_(W),
        c_(c),
        multipliers_(multipliers),
        scale_of_(n_),
        state_(n_, 0),
        x_(n_),
        w_(n_) {
    for (size_t i = 0; i < n_; ++i) scale_of_[i] = std::sqrt(W[i * n_ + i]);
    for (size_t i = 0; i < n_; ++i) {
      for (size_t j = 0; j < n_; ++j) W_[i * n_ + j] /= scale_of_[i] * scale_of_[j];
      c_[i] /= scale_of_[i], largest_c_ = std::max(largest_c_, std::fabs(c_[i])),
                             noise_ = std::max(noise_, noise[i] / scale_of_[i]);
      Multiplier& m = multipliers_[i];
      m.lower *= scale_of_[i], m.upper *= scale_of_[i];
      if (m.normal < 0) continue;
      const double ratio = scale_of_[i] / scale_of_[m.normal];
      m.friction *= ratio, m.sliding_ratio *= ratio;
    }
  }

  bool has_positive_diagonal() const {
    return std::all_of(scale_of_.begin(), scale_of_.end(), [](double x) { return x > 0 && std::isfinite(x); });
  }

  double total_states() const {
    double out = 1;
    for (size_t i = 0; i < n_; ++i) out *= state_count(i);
    return out;
  }

  // Find the first consistent state; false if there is none, or if another one has a different solution.
  bool solve(Vector& x, Vector& w) {
    bool found = false;
    do {
      if (!solve_state() || !is_consistent()) continue;
      if (!found) {
        x = x_, w = w_, found = true;
      } else if (differ(w, w_) || (!only_rates_matter() && differ(x, x_))) {
        return false;
      }
    } while (next());
    for (size_t i = 0; found && i < n_; ++i) x[i] /= scale_of_[i], w[i] *= scale_of_[i];
    return found;
  }

 private:
  // Number of states of a multiplier: at each finite bound and between them; if tangential, sticking and at both
  // limits.
  int state_count(size_t i) const {
    const Multiplier& m = multipliers_[i];
    if (m.normal >= 0) return std::isnan(m.sliding_ratio) ? 3 : 1;
    return 1 + std::isfinite(m.lower) + std::isfinite(m.upper);
  }
  bool at_lower(size_t i) const { return state_[i] == 0 && std::isfinite(multipliers_[i].lower); }
  bool at_upper(size_t i) const {
    return std::isfinite(multipliers_[i].upper) && state_[i] == std::isfinite(multipliers_[i].lower);
  }
  bool is_active(size_t normal) const { return !at_lower(normal); }
  double ratio(size_t i) const {  // ratio of a tangential multiplier to its normal multiplier
    return !std::isnan(multipliers_[i].sliding_ratio) ? multipliers_[i].sliding_ratio
                                                      : multipliers_[i].friction * (state_[i] == 1 ? 1 : -1);
  }
  bool is_free(size_t i) const {
    const Multiplier& m = multipliers_[i];
    if (m.normal >= 0) return is_active(m.normal) && std::isnan(m.sliding_ratio) && state_[i] == 0;
    return !at_lower(i) && !at_upper(i);
  }
  bool is_proportional(size_t i) const {
    return multipliers_[i].normal >= 0 && is_active(multipliers_[i].normal) && !is_free(i);
  }

  bool next() {
    for (size_t i = 0; i < n_; ++i) {
      if (++state_[i] < state_count(i)) return true;
      state_[i] = 0;
    }
    return false;
  }

  bool solve_state() {
    std::vector<size_t> unknowns;
    for (size_t i = 0; i < n_; ++i) {
      const Multiplier& m = multipliers_[i];
      if (m.normal >= 0 && !is_active(m.normal) && state_[i]) return false;  // equal to state 0
      x_[i] = m.normal >= 0 ? 0 : at_lower(i) ? m.lower : at_upper(i) ? m.upper : 0;
      if (is_free(i)) unknowns.push_back(i);
    }
    const int r = static_cast<int>(unknowns.size());
    BandLU A;
    Vector b(r);
    A.resize(r, std::max(r - 1, 0));
    for (int i = 0; i < r; ++i) {
      const double* row = &W_[unknowns[i] * n_];
      b[i] = -c_[unknowns[i]];
      for (size_t j = 0; j < n_; ++j) b[i] -= row[j] * x_[j];
      for (int j = 0; j < r; ++j) {
        double a = row[unknowns[j]];
        for (size_t k = 0; k < n_; ++k)
          if (is_proportional(k) && multipliers_[k].normal == static_cast<int>(unknowns[j])) a += row[k] * ratio(k);
        A.at(i, j) = a;
      }
    }
    if (r && !(A.factorize() && A.pivot_ratio() > tolerances_.solution_rounding)) return false;
    if (r) A.solve(b.data());
    for (int i = 0; i < r; ++i) x_[unknowns[i]] = b[i];
    for (size_t i = 0; i < n_; ++i)
      if (is_proportional(i)) x_[i] = ratio(i) * x_[multipliers_[i].normal];
    for (size_t i = 0; i < n_; ++i) {
      w_[i] = c_[i];
      for (size_t j = 0; j < n_; ++j) w_[i] += W_[i * n_ + j] * x_[j];
    }
    return true;
  }

  bool is_consistent() const {
    const double zero = tolerances_.solution_rounding * largest() + noise_;
    for (size_t i = 0; i < n_; ++i) {
      const Multiplier& m = multipliers_[i];
      if (is_free(i)) {
        const double friction_limit = m.normal >= 0 ? m.friction * x_[m.normal] : 0;
        if (m.normal >= 0 ? std::fabs(x_[i]) > friction_limit + zero : x_[i] < m.lower - zero || x_[i] > m.upper + zero)
          return false;
      } else if (m.normal < 0) {
        if (at_lower(i) ? w_[i] < -zero : w_[i] > zero) return false;
      } else if (is_proportional(i) && std::isnan(m.sliding_ratio) && w_[i] * ratio(i) > zero * m.friction) {
        return false;
      }
    }
    return true;
  }

  double largest() const {
    double out = largest_c_;
    for (double x : x_) out = std::max(out, std::fabs(x));
    return out;
  }
  bool differ(const Vector& a, const Vector& b) const {
    const double zero = tolerances_.same_state * largest() + noise_;
    for (size_t i = 0; i < n_; ++i)
      if (std::fabs(a[i] - b[i]) > zero) return true;
    return false;
  }
  bool only_rates_matter() const {
    return std::all_of(multipliers_.begin(), multipliers_.end(),
                       [](const Multiplier& m) { return m.normal < 0 && m.bounded(); });
  }

  const Tolerances& tolerances_;
  const size_t n_;
  Vector W_, c_;
  std::vector<Multiplier> multipliers_;
  Vector scale_of_;
  double largest_c_ = 0, noise_ = 0;
  std::vector<int> state_;
  Vector x_, w_;
};

}  // namespace

bool solve_complementarity(const Vector& W, const Vector& c, const Vector& noise,
                           const std::vector<Multiplier>& multipliers, const Tolerances& tolerances, int max_states,
                           Vector& x, Vector& w) {
  x.clear(), w.clear();
  if (multipliers.empty()) return true;
  Problem problem(W, c, noise, multipliers, tolerances);
  return problem.has_positive_diagonal() && problem.total_states() <= max_states && problem.solve(x, w);
}

}  // namespace mbdae
