// The differential equation of an exported mechanism in local coordinates, and its derivatives.
#include <cmath>
#include <stdexcept>

#include "math/vec3.hpp"
#include "runtime/exported_mechanism.hpp"

namespace mbdae {

void ExportedMechanism::restart() {
  if (coordinates_) evaluate();
  Index2System& s = system();
  origin_ = y(), origin_.back() = 0, origin_t_ = time();
  coordinates_.reset();  // its rows are selected at the new origin
  State at;
  at.y = origin_;
  try {
    s.update_independent_rows(time(), at);
    coordinates_ = std::make_unique<LocalCoordinates>(s, limits_, time(), origin_.data());
  } catch (const FallBackToPython&) {
    throw std::runtime_error("the constraints are singular at t = " + std::to_string(time()) + " s");
  }
  if (coordinates_->size() != states_) throw std::runtime_error("the degrees of freedom have changed");
  x_ = coordinates_->origin(), current_ = derivatives_current_ = false;
}

void ExportedMechanism::evaluate() {
  if (current_) return;
  if (!coordinates_) throw std::invalid_argument("equations follow the initialization of a model exchange");
  derivatives_current_ = false;
  coordinates_->rate(time(), x_.data(), y().data(), rate_.data());
  current_ = true;
}

const Numbers& ExportedMechanism::rate() {
  evaluate();
  return rate_;
}

double ExportedMechanism::margin() {
  evaluate();
  return coordinates_->margin();
}

const ExportedMechanism::Derivatives& ExportedMechanism::derivatives() {
  evaluate();
  if (derivatives_current_) return derivatives_;
  const size_t m = inputs.size(), n = states_, wide = n + m;
  LocalCoordinates::Partials p;
  const auto set = [&](int i, double change) {
    system().set_input(i, time(), settings_[i].value + change, 0);
  };
  coordinates_->partials(time(), x_.data(), static_cast<int>(m), set, p);
  derivatives_.rates = p.x, derivatives_.outputs.assign(outputs.size() * wide, 0.0);
  for (size_t i = 0; i < outputs.size(); ++i)
    for (size_t c = 0; c < wide; ++c) derivatives_.outputs[i * wide + c] = output_partial(outputs[i], p, c, wide);
  derivatives_current_ = true;
  return derivatives_;
}

double ExportedMechanism::output_partial(const SignalValue& signal, const LocalCoordinates::Partials& p, size_t c,
                                         size_t wide) {
  using Kind = SignalValue::Kind;
  const Index2System& s = system();
  const size_t n = states_, i = signal.i, nq = s.nq;
  switch (signal.kind) {
    case Kind::t:
      return 0;
    case Kind::y:
      if (c >= n) return 0;
      return i < nq ? p.raw[i * n + c] : p.y[(i - nq + s.nv) * n + c];
    case Kind::angle:
      return c < n ? p.y[signal.rate * n + c] : 0;
    case Kind::rate:
      return p.F[i * wide + c];
    case Kind::lam:
      return p.lam[signal.rows[0] * wide + c];
    case Kind::force: {
      const Numbers& lam = s.multipliers();
      double size = 0, along = 0;
      for (int k : signal.rows) size += lam[k] * lam[k], along += lam[k] * p.lam[k * wide + c];
      return along / std::sqrt(size);
    }
    default:
      throw std::invalid_argument("an output has no derivative");
  }
}

}  // namespace mbdae
