#include "run/complementarity.hpp"

#include <algorithm>

namespace mbdae {

namespace {

// In units in which the diagonal of W is 1.
class Problem {
 public:
  Problem(const Vector& W, const Vector& c, const Vector& noise, const std::vector<Multiplier>& all,
          const Tolerances& limits)
      : limits_(limits), n_(all.size()), W_(W), c_(c), all_(all), size_(n_), state_(n_, 0), x_(n_), w_(n_) {
    for (size_t i = 0; i < n_; ++i) size_[i] = std::sqrt(W[i * n_ + i]);
    for (size_t i = 0; i < n_; ++i) {
      for (size_t j = 0; j < n_; ++j) W_[i * n_ + j] /= size_[i] * size_[j];
      c_[i] /= size_[i], scale_ = std::max(scale_, std::fabs(c_[i])), noise_ = std::max(noise_, noise[i] / size_[i]);
      Multiplier& m = all_[i];
      m.lower *= size_[i], m.upper *= size_[i];
      if (m.normal < 0) continue;
      const double ratio = size_[i] / size_[m.normal];
      m.friction *= ratio, m.sliding_ratio *= ratio;
    }
  }

  bool regular() const {
    return std::all_of(size_.begin(), size_.end(), [](double x) { return x > 0 && std::isfinite(x); });
  }

  double states() const {
    double out = 1;
    for (size_t i = 0; i < n_; ++i) out *= count(i);
    return out;
  }

  // Of all states, the first one that is consistent; false where others give something else.
  bool solve(Vector& x, Vector& w) {
    bool found = false;
    do {
      if (!solve_state() || !consistent()) continue;
      if (!found) {
        x = x_, w = w_, found = true;
      } else if (differ(w, w_) || (!only_rates_matter() && differ(x, x_))) {
        return false;
      }
    } while (next());
    for (size_t i = 0; found && i < n_; ++i) x[i] /= size_[i], w[i] *= size_[i];
    return found;
  }

 private:
  // States: at the bounds that are finite, then between them; of tangential ones, sticking, and at both limits.
  int count(size_t i) const {
    const Multiplier& m = all_[i];
    if (m.normal >= 0) return std::isnan(m.sliding_ratio) ? 3 : 1;
    return 1 + std::isfinite(m.lower) + std::isfinite(m.upper);
  }
  bool at_lower(size_t i) const { return state_[i] == 0 && std::isfinite(all_[i].lower); }
  bool at_upper(size_t i) const { return std::isfinite(all_[i].upper) && state_[i] == std::isfinite(all_[i].lower); }
  bool is_active(size_t normal) const { return !at_lower(normal); }
  double ratio(size_t i) const {  // of a tangential multiplier to the normal one
    return !std::isnan(all_[i].sliding_ratio) ? all_[i].sliding_ratio : all_[i].friction * (state_[i] == 1 ? 1 : -1);
  }
  bool free(size_t i) const {
    const Multiplier& m = all_[i];
    if (m.normal >= 0) return is_active(m.normal) && std::isnan(m.sliding_ratio) && state_[i] == 0;
    return !at_lower(i) && !at_upper(i);
  }
  bool proportional(size_t i) const { return all_[i].normal >= 0 && is_active(all_[i].normal) && !free(i); }

  bool next() {
    for (size_t i = 0; i < n_; ++i) {
      if (++state_[i] < count(i)) return true;
      state_[i] = 0;
    }
    return false;
  }

  bool solve_state() {
    std::vector<size_t> unknown;
    for (size_t i = 0; i < n_; ++i) {
      const Multiplier& m = all_[i];
      if (m.normal >= 0 && !is_active(m.normal) && state_[i]) return false;  // the same again
      x_[i] = m.normal >= 0 ? 0 : at_lower(i) ? m.lower : at_upper(i) ? m.upper : 0;
      if (free(i)) unknown.push_back(i);
    }
    const int r = static_cast<int>(unknown.size());
    BandLU A;
    Vector b(r);
    A.resize(r, std::max(r - 1, 0));
    for (int i = 0; i < r; ++i) {
      const double* row = &W_[unknown[i] * n_];
      b[i] = -c_[unknown[i]];
      for (size_t j = 0; j < n_; ++j) b[i] -= row[j] * x_[j];
      for (int j = 0; j < r; ++j) {
        double a = row[unknown[j]];
        for (size_t k = 0; k < n_; ++k)
          if (proportional(k) && all_[k].normal == static_cast<int>(unknown[j])) a += row[k] * ratio(k);
        A.at(i, j) = a;
      }
    }
    if (r && !(A.factorize() && A.pivot_ratio() > limits_.solution_rounding)) return false;
    if (r) A.solve(b.data());
    for (int i = 0; i < r; ++i) x_[unknown[i]] = b[i];
    for (size_t i = 0; i < n_; ++i)
      if (proportional(i)) x_[i] = ratio(i) * x_[all_[i].normal];
    for (size_t i = 0; i < n_; ++i) {
      w_[i] = c_[i];
      for (size_t j = 0; j < n_; ++j) w_[i] += W_[i * n_ + j] * x_[j];
    }
    return true;
  }

  bool consistent() const {
    const double zero = limits_.solution_rounding * largest() + noise_;
    for (size_t i = 0; i < n_; ++i) {
      const Multiplier& m = all_[i];
      if (free(i)) {
        const double most = m.normal >= 0 ? m.friction * x_[m.normal] : 0;
        if (m.normal >= 0 ? std::fabs(x_[i]) > most + zero : x_[i] < m.lower - zero || x_[i] > m.upper + zero)
          return false;
      } else if (m.normal < 0) {
        if (at_lower(i) ? w_[i] < -zero : w_[i] > zero) return false;
      } else if (proportional(i) && std::isnan(m.sliding_ratio) && w_[i] * ratio(i) > zero * m.friction) {
        return false;
      }
    }
    return true;
  }

  double largest() const {
    double out = scale_;
    for (double x : x_) out = std::max(out, std::fabs(x));
    return out;
  }
  bool differ(const Vector& a, const Vector& b) const {
    const double zero = limits_.same_state * largest() + noise_;
    for (size_t i = 0; i < n_; ++i)
      if (std::fabs(a[i] - b[i]) > zero) return true;
    return false;
  }
  bool only_rates_matter() const {
    return std::all_of(all_.begin(), all_.end(), [](const Multiplier& m) { return m.normal < 0 && m.bounded(); });
  }

  const Tolerances& limits_;
  const size_t n_;
  Vector W_, c_;
  std::vector<Multiplier> all_;
  Vector size_;
  double scale_ = 0, noise_ = 0;
  std::vector<int> state_;
  Vector x_, w_;
};

}  // namespace

bool solve_complementarity(const Vector& W, const Vector& c, const Vector& noise,
                           const std::vector<Multiplier>& multipliers, const Tolerances& limits, int max_states,
                           Vector& x, Vector& w) {
  x.clear(), w.clear();
  if (multipliers.empty()) return true;
  Problem problem(W, c, noise, multipliers, limits);
  return problem.regular() && problem.states() <= max_states && problem.solve(x, w);
}

}  // namespace mbdae
