#include "stage_solver.hpp"

#include <Eigen/LU>

namespace mbdae {

namespace {

template <class T>
Vector<T> numbers_of(const Vector<Complex>& x);
template <>
Vector<double> numbers_of<double>(const Vector<Complex>& x) { return x.real(); }
template <>
Vector<Complex> numbers_of<Complex>(const Vector<Complex>& x) { return x; }

template <class T>
class ModeSolver final : public StageSolver {
 public:
  ModeSolver(std::shared_ptr<const LinearizedStages> slopes, int nv, T mu) : at_(std::move(slopes)), nv_(nv), mu_(mu) {
    const Slopes& s = at_->slopes;
    r_ = static_cast<int>(s.g_t.size()), n_ = static_cast<int>(s.K.size()) / nv;
    const RowsIn M(s.M.data(), nv, nv), K(s.K.data(), n_, nv), D(s.D.data(), n_, n_);
    const RowsIn G(s.G.data(), r_, nv), B(s.B.data(), r_, nv);
    for (const TangentBlock& b : at_->turning) {
      const RowsIn J(b.J, b.n, b.n), turn(b.turn, b.n, b.n);
      const Rows<T> J_T = J.cast<T>(), middle = Rows<T>::Identity(b.n, b.n) - mu * turn.cast<T>();
      S_.push_back((middle * J_T).inverse());
    }
    Rows<T> A = Rows<T>::Zero(n_ + r_, n_ + r_);
    A.topLeftCorner(n_, n_) = -mu * D.cast<T>();
    A.topLeftCorner(n_, nv) -= (mu * mu) * turned(K);
    A.topLeftCorner(nv, nv) += M.cast<T>();
    for (int i = nv; i < n_; ++i) A(i, i) += T(1);
    A.block(0, n_, nv, r_) = -G.transpose().cast<T>();
    for (int i = 0; i < r_; ++i) A(n_ - 1, n_ + i) = T(s.g_t[i]);
    A.block(n_, 0, r_, nv) = G.cast<T>() + mu * turned(B);
    lu_.compute(A);
    for (int i = 0; i < n_ + r_; ++i) {
      const double pivot = std::abs(lu_.matrixLU()(i, i));
      if (!(pivot > 0) || !std::isfinite(pivot)) throw Trouble();
    }
  }

  void solve(Vector<Complex>& r, Vector<Complex>& c) const override {
    const Slopes& s = at_->slopes;
    const RowsIn K(s.K.data(), n_, nv_), B(s.B.data(), r_, nv_);
    Vector<T> rx = numbers_of<T>(r.head(nv_)), b(n_ + r_), x = rx;
    blocks(x, false);
    b.head(n_) = numbers_of<T>(r.tail(n_)) + mu_ * (K.template cast<T>() * x);
    b.tail(r_) = numbers_of<T>(c) / mu_ - B.template cast<T>() * x;
    const Vector<T> u = lu_.solve(b);
    x = u.head(nv_);
    blocks(x, true);
    x = rx + mu_ * x;
    blocks(x, false), blocks(x, true);
    r.head(nv_) = x.template cast<Complex>(), r.tail(n_) = u.head(n_).template cast<Complex>();
    c = u.tail(r_).template cast<Complex>();
  }

 private:
  Rows<T> turned(const RowsIn& K) const {  // K S J
    Rows<T> out = K.cast<T>();
    for (size_t i = 0; i < S_.size(); ++i) {
      const TangentBlock& b = at_->turning[i];
      const Rows<T> SJ = S_[i] * RowsIn(b.J, b.n, b.n).cast<T>();
      out.middleCols(b.at, b.n) = (K.middleCols(b.at, b.n).cast<T>() * SJ).eval();
    }
    return out;
  }

  void blocks(Vector<T>& x, bool J) const {  // x := S x, or J x
    for (size_t i = 0; i < S_.size(); ++i) {
      const TangentBlock& b = at_->turning[i];
      const Vector<T> part = x.segment(b.at, b.n);
      if (J)
        x.segment(b.at, b.n) = RowsIn(b.J, b.n, b.n).cast<T>() * part;
      else
        x.segment(b.at, b.n) = S_[i] * part;
    }
  }

  std::shared_ptr<const LinearizedStages> at_;
  int nv_, n_, r_;
  T mu_;
  std::vector<Rows<T>> S_;  // of each block
  Eigen::PartialPivLU<Rows<T>> lu_;
};

}  // namespace

std::shared_ptr<const StageSolver> solver(const std::shared_ptr<const LinearizedStages>& slopes, int nv, Complex mu) {
  if (mu.imag() == 0) return std::make_shared<ModeSolver<double>>(slopes, nv, mu.real());
  return std::make_shared<ModeSolver<Complex>>(slopes, nv, mu);
}

}  // namespace mbdae
