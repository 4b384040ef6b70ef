// Half-explicit and collocation steps that record their stages, for tangents and adjoints.
#include <algorithm>

#include "sensitivity/general_step_sensitivity.hpp"
#include "steps/ggl.hpp"
#include "steps/formulations.hpp"

namespace mbdae {

namespace {

template <class Step>
class RecordingHalfExplicit final : public Step, public StageRecorder {
 public:
  RecordingHalfExplicit(Index2System& s, const Tableau& a) : Step(s), a_(a), z_(s.nz) {}

  void take(double t, double h, const State& in, State& out) override {
    stages.clear();
    Step::take(a_, t, h, in, out, z_.data(), errors_);
    F = Eigen::Map<const Rows<double>, 0, Eigen::OuterStride<>>(this->F_.data(), a_.n, this->ny_,
                                                                Eigen::OuterStride<>(this->stride_));
    if constexpr (is_ggl) positions = &this->positions_.rows();
  }

 protected:
  void stage(double t, double t_hat, double factor, double* F, bool last) override {
    Step::stage(t, t_hat, factor, F, last);
    const int nv = this->nv_, ny = this->ny_;
    StageValues v{t, t_hat, Vector(this->x_.begin(), this->x_.begin() + ny),
                  Vector(this->xhat_.begin(), this->xhat_.begin() + 2 * nv), Vector(F, F + ny),
                  Vector(this->s_.ng, 0.0), {}, {}};
    for (int i = 0; i < 2 * nv; ++i) v.xhat[i] += factor * F[i];
    for (int k : this->s_.rows.in_use()) v.lam[k] = this->lam_[k];
    if constexpr (is_ggl) v.mu = this->mu_, v.mu_velocity = this->mu_velocity_;
    stages.push_back(std::move(v));
  }

 private:
  static constexpr bool is_ggl = std::is_same_v<Step, GGLStep>;
  const Tableau& a_;
  Vector z_, errors_;
};

template <class Step>
class RecordingCollocation final : public Step, public StageRecorder {
 public:
  RecordingCollocation(Index2System& s, const Radau& a) : Step(s), a_(a), z_(s.nz) {}

  void take(double t, double h, const State& in, State& out) override {
    State start;
    start.y = in.y, t_ = t;
    Step::take(a_, false, t, h, start, out, z_.data(), errors_);
    memory_ = out.memory;
    record();
  }

  void initial_guess(double t, double h, const State& in) override {
    Index2System& s = this->s_;
    this->y0_ = in.y, t_ = t;
    this->begin_step(in.y.data());
    auto m = std::make_shared<StageMemory>();
    m->unknowns = this->unknowns(), m->h = h;
    Vector rate(s.ny), lam(s.ng);
    s.derivative(t, in.y.data(), rate.data(), lam.data());
    for (int i = 0; i < a_.s; ++i) {
      m->K.insert(m->K.end(), rate.begin(), rate.end());
      for (size_t k = 0; k < m->unknowns.size(); ++k)
        m->Z.push_back(k < rows_in_use() ? s.multipliers()[m->unknowns[k]] : 0);
    }
    memory_ = m, record();
  }

  void extend(double h) override { memory_ = resample(a_, *memory_, 0, h), record(); }

  Eigen::VectorXd negative_residual(int i) override {
    const StageValues& v = stages[i];
    const int nv = this->nv_, ny = this->ny_, r = static_cast<int>(rows_in_use()), n_unknowns = unknown_count();
    Vector R(ny), C(n_unknowns);
    Step::residual(v.t, v.x.data(), v.F.data(), &memory_->Z[static_cast<size_t>(i) * n_unknowns], R.data(), C.data());
    Eigen::VectorXd out = Eigen::VectorXd::Zero(ny + n_unknowns + (is_ggl ? nv : 0));
    std::copy(R.begin(), R.end(), out.data()), std::copy(C.begin(), C.begin() + r, out.data() + ny);
    std::copy(C.begin() + r, C.end(), out.data() + out.size() - (n_unknowns - r));
    return out;
  }

  void correct(const Rows<double>& change) override {
    const int ny = this->ny_, r = static_cast<int>(rows_in_use()), n_unknowns = unknown_count();
    auto m = std::make_shared<StageMemory>(*memory_);
    for (int i = 0; i < a_.s; ++i) {
      for (int k = 0; k < ny; ++k) m->K[i * ny + k] += change(i, k);
      for (int k = 0; k < n_unknowns; ++k)
        m->Z[i * n_unknowns + k] += change(i, k < r ? ny + k : static_cast<int>(change.cols()) - n_unknowns + k);
    }
    memory_ = m, record();
  }

  void finish(const State& in, State& out) override {
    State start;
    start.y = in.y, start.memory = resample(a_, *memory_, -memory_->h, memory_->h);
    const double h = memory_->h;
    Step::take(a_, false, t_, h, start, out, z_.data(), errors_);
    memory_ = out.memory;
    record();
  }

 private:
  static constexpr bool is_ggl = std::is_same_v<Step, GGLCollocation>;

  size_t rows_in_use() const { return this->s_.rows.in_use().size(); }
  int unknown_count() const { return static_cast<int>(memory_->unknowns.size()); }

  void record() {
    const StageMemory& m = *memory_;
    F = ConstMatrixMap(m.K.data(), a_.s, this->ny_);
    const Rows<double> X = m.h * ConstMatrixMap(a_.A.data(), a_.s, a_.s).lazyProduct(F);
    if constexpr (is_ggl) positions = &this->positions_.rows();
    stages.clear();
    for (int i = 0; i < a_.s; ++i) {
      const double *x = X.row(i).data(), *K = F.row(i).data(), time = t_ + a_.c[i] * m.h;
      stages.push_back({time,
                        time,
                        Vector(x, x + this->ny_),
                        Vector(x, x + 2 * this->nv_),
                        Vector(K, K + this->ny_),
                        Vector(this->s_.ng, 0.0),
                        {},
                        {}});
      multipliers(stages.back(), &m.Z[static_cast<size_t>(i) * unknown_count()], unknown_count());
    }
  }

  // The iteration leaves larger errors in the multipliers than in x and x'; recompute them from x and x'.
  void multipliers(StageValues& v, const double* z, int r) {
    Index2System& s = this->s_;
    const std::vector<int>& rows = s.rows.in_use();
    const int nv = this->nv_;
    Vector R(this->ny_), C(r);
    this->residual(v.t, v.x.data(), v.F.data(), z, R.data(), C.data());
    s.point.evaluate(this->q_.data(), true);
    for (size_t k = 0; k < rows.size(); ++k) v.lam[rows[k]] = z[k];
    if (!rows.empty()) s.saddle.factorize_symmetric(), s.saddle.update_multipliers(&R[nv], v.lam.data());
    if constexpr (is_ggl) {
      Vector mu_velocity(v.F.begin(), v.F.begin() + nv), rates(s.ng, 0.0);
      s.manifold.velocity(v.x.data(), mu_velocity.data());
      for (int i = 0; i < nv; ++i) mu_velocity[i] -= this->u_[i];
      for (int k : this->positions_.in_use()) rates[k] = s.constraints.times(k, s.point.G, mu_velocity.data());
      v.mu.assign(s.ng, 0.0), v.mu_velocity.assign(nv, 0.0);
      if (this->positions_.in_use().empty()) return;
      this->positions_.saddle().factorize_symmetric();
      this->positions_.saddle().minimum_norm_correction(rates.data(), v.mu_velocity.data(), v.mu.data());
    }
  }

  const Radau& a_;
  double t_ = 0;
  std::shared_ptr<const StageMemory> memory_;
  Vector z_, errors_;
};

}  // namespace

std::unique_ptr<StageRecorder> recorder(Index2System& s, const Tableau& a) {
  if (s.formulation == Formulation::ggl) return std::make_unique<RecordingHalfExplicit<GGLStep>>(s, a);
  return std::make_unique<RecordingHalfExplicit<HalfExplicitStep>>(s, a);
}

std::unique_ptr<StageRecorder> recorder(Index2System& s, const Radau& a) {
  if (s.formulation == Formulation::ggl) return std::make_unique<RecordingCollocation<GGLCollocation>>(s, a);
  return std::make_unique<RecordingCollocation<CollocationStep>>(s, a);
}

}  // namespace mbdae
