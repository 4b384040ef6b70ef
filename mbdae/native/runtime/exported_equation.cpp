// The ordinary differential equation of an exported mechanism in local coordinates, and its partials.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "math/vec3.hpp"
#include "runtime/exported_mechanism.hpp"

namespace mbdae {

void ExportedMechanism::restart() { evaluate(), begin_coordinates(); }

void ExportedMechanism::begin_coordinates() {
  Index2System& s = system();
  origin_ = y(), origin_.back() = 0, origin_t_ = time();
  coordinates_.reset();  // rows are selected at the new origin
  State state;
  state.y = origin_;
  try {
    s.update_independent_rows(time(), state);
    coordinates_ = std::make_unique<LocalCoordinates>(s, limits_, time(), origin_.data());
  } catch (const FallBackToPython&) {
    fail("the constraints are singular");
  }
  if (coordinates_->size() > states_) fail("the mechanism has more degrees of freedom than at its start,");
  x_ = coordinates_->origin(), x_.resize(states_, 0.0), rate_.assign(states_, 0.0);
  current_ = derivatives_current_ = false;
}

void ExportedMechanism::evaluate() {
  if (current_) return;
  if (!coordinates_) throw std::invalid_argument("a model exchange must be initialized before its equations");
  derivatives_current_ = false;
  coordinates_->rate(time(), x_.data(), y().data(), rate_.data());
  current_ = true;
}

const Vector& ExportedMechanism::rate() {
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
  const size_t m = inputs.size(), n = coordinates_->size(), width = n + m, padding = states_ - n;
  LocalCoordinates::Partials p;
  const auto set = [&](int i, double change) {
    system().set_input(i, time(), settings_[i].value + change, 0);
  };
  coordinates_->partials(time(), x_.data(), static_cast<int>(m), set, p);
  const size_t total = states_ + m;
  derivatives_.rates.assign(states_ * total, 0.0), derivatives_.outputs.assign(outputs.size() * total, 0.0);
  for (size_t c = 0; c < width; ++c) {
    const size_t column = c < n ? c : c + padding;
    for (size_t i = 0; i < n; ++i) derivatives_.rates[i * total + column] = p.x[i * width + c];
    for (size_t i = 0; i < outputs.size(); ++i)
      derivatives_.outputs[i * total + column] = output_partial(outputs[i], p, c, width);
  }
  derivatives_current_ = true;
  return derivatives_;
}

// Multipliers of dependent rows are those of minimum norm, but the partials are those of the rows in use.
void ExportedMechanism::require_determinate(const std::vector<int>& rows) {
  const Index2System& s = system();
  const auto inactive = std::count(s.constraints.inactive.begin(), s.constraints.inactive.end(), true);
  bool indeterminate = s.ng - static_cast<int>(inactive) - s.rows.rank > dependent_rows_;
  for (int k : rows)
    indeterminate = indeterminate ||
                    std::find(indeterminate_rows_.begin(), indeterminate_rows_.end(), k) != indeterminate_rows_.end();
  if (indeterminate)
    throw std::invalid_argument("multipliers and forces of statically indeterminate constraints have no derivatives");
}

double ExportedMechanism::output_partial(const SignalValue& signal, const LocalCoordinates::Partials& p, size_t c,
                                         size_t width) {
  using Kind = SignalValue::Kind;
  const Index2System& s = system();
  const size_t n = width - inputs.size(), i = signal.i, nq = s.nq;
  switch (signal.kind) {
    case Kind::t:
      return 0;
    case Kind::y:
      if (c >= n) return 0;
      return i < nq ? p.raw[i * n + c] : p.y[(i - nq + s.nv) * n + c];
    case Kind::angle:
      return c < n ? p.y[signal.rate * n + c] : 0;
    case Kind::rate:
      return p.F[i * width + c];
    case Kind::lam:
      require_determinate(signal.rows);
      return p.lam[signal.rows[0] * width + c];
    case Kind::force: {
      require_determinate(signal.rows);
      const Vector& lam = s.multipliers();
      double size = 0, force_dot_derivative = 0;
      bool any_active = false;
      for (int k : signal.rows) {
        size += lam[k] * lam[k], force_dot_derivative += lam[k] * p.lam[k * width + c];
        any_active = any_active || s.constraints.inactive.empty() || !s.constraints.inactive[k];
      }
      if (any_active && size == 0)
        throw std::invalid_argument("the magnitude of a force has no derivative where it is zero");
      return any_active ? force_dot_derivative / std::sqrt(size) : 0;
    }
    default:
      throw std::invalid_argument("an output of this kind has no derivatives");
  }
}

}  // namespace mbdae
