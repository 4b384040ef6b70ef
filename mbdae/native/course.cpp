// Many steps in a row: what solve.py and pace.py do where nothing unusual happens.
#include <algorithm>
#include <cmath>

#include "core.hpp"
#include "small.hpp"

namespace mbdae {

namespace {

constexpr double NOTHING = 1e-100;  // keeps the scale of a component positive where neither tolerance does

double spacing(double t) { return std::nextafter(t, INFINITY) - t; }

}  // namespace

// The size of the next step and the time where it ends; false where Python has something to say about it.
bool Core::propose(Course& c, double& h, double& t_next) {
  const double left = std::fabs(c.stop - c.t);
  if (c.adaptive) {
    h = std::min(c.h, c.largest);
    c.cut = h > left ? c.h : 0.0;
    if (h >= left * (1 - 1e-10)) {
      h = left, t_next = c.end;
      return true;
    }
    if (!(h >= 16 * spacing(std::max(std::fabs(c.t), std::fabs(c.t1))))) return false;
    t_next = c.t + c.sign * h;
    return true;
  }
  const long i = c.i + 1;
  const bool started = c.on_grid;
  const double t = i >= c.n ? c.t1 : c.t0 + c.sign * i * c.step;
  const double beyond = c.sign * (t - c.stop);
  c.on_grid = beyond <= c.near * c.step;
  c.i += c.on_grid;
  if (beyond >= -c.near * c.step)
    h = left, t_next = c.end;
  else
    h = started ? c.step : std::fabs(t - c.t), t_next = t;
  return true;
}

// What rounding makes of v at a stage, eps |v| / (h ahat_ii), cannot be controlled: `noise` adds to the scale of v.
double Core::error(const Course& c, const double* e, int errors, const double* size0, const double* size1,
                   double noise) const {
  const int n = measured();
  double norms[2] = {0, 0};
  for (int i = 0; i < errors && i < 2; ++i) {
    double s = 0;
    for (int k = 0; k < n; ++k) {
      double scale = c.atol[c.atol.size() == 1 ? 0 : k] + c.rtol * std::max(size0[k], size1[k]) + NOTHING;
      if (k >= nv && k < 2 * nv) scale += noise;
      const double x = e[static_cast<size_t>(i) * ny + k] / scale;
      s += x * x;
    }
    norms[i] = std::sqrt(s / n);
  }
  if (errors == 1 || norms[0] == 0) return norms[0];
  return norms[0] * norms[0] / (norms[0] + 0.01 * norms[1]);
}

double Core::next_step(Course& c, double h, double err) const {  // see mbdae/methods/controller.py
  if (!(err <= 1)) {
    c.was_rejected = true;
    const double shrink = std::isfinite(err) ? c.safety * std::pow(err, -1 / c.power) : 0.0;
    return h * std::max(c.smallest_factor, shrink);
  }
  err = std::max(err, 1e-10);
  double factor = c.safety * std::pow(err, 0.75 * c.beta - 1 / c.power) * std::pow(c.last, c.beta);
  factor = std::min(c.was_rejected ? 1.0 : c.largest_factor, std::max(c.smallest_factor, factor));
  c.last = std::max(err, 1e-4), c.was_rejected = false;
  return h * factor;
}

// Fixed steps: does this one lead into a singular configuration, where another one can be taken? See SingularWatch.
bool Core::landing(const Course& c, const State& next) {
  if (!c.on_grid || c.i >= c.n) return false;
  const double end = c.i + 1 == c.n ? c.t1 : c.t0 + c.sign * (c.i + 1) * c.step;
  if (c.sign * (c.stop - end) < 0) return false;
  const double nearest = std::min(std::sqrt(weakest), c.before), limit = c.landed * std::min(c.usual, c.before);
  if (nearest < limit) return true;
  return nearest < c.suspect * c.usual && ratio(next.y.data()) < limit;
}

void Core::march(const Tableau& tableau, Course& c) {
  using Clock = std::chrono::steady_clock;
  const auto started = Clock::now();
  Numbers errors, size0(ny), size1(ny), z(std::max(ng, 1)), move(ny), F(ny), again(std::max(ng, 1));
  State next;
  const bool control = c.adaptive || c.project;
  if (control) size(c.state.y.data(), size0.data());
  const int n = measured();
  while (c.taken + c.rejected < c.budget && c.t != c.end) {
    const Course before = [&] {  // what a step that is given up must not have changed
      Course x;
      x.h = c.h, x.cut = c.cut, x.last = c.last, x.was_rejected = c.was_rejected, x.i = c.i, x.on_grid = c.on_grid;
      return x;
    }();
    const Counts counted = counts;
    auto give_up = [&] {
      c.h = before.h, c.cut = before.cut, c.last = before.last, c.was_rejected = before.was_rejected;
      c.i = before.i, c.on_grid = before.on_grid;
      counts = counted, stands_ = false, c.stuck = true;
    };
    double h, t_next;
    if (!propose(c, h, t_next)) {
      give_up();
      return;
    }
    if (c.watched) weakest = 1;
    try {
      if (c.adaptive)
        controlled(tableau, c.t, c.sign * h, c.state, next, z.data(), errors);
      else
        step(tableau, c.t, c.sign * h, c.state, next, z.data(), errors);
      if (control) size(next.y.data(), size1.data());
      if (c.adaptive) {
        const double noise = ng ? tableau.noise * largest(next.y.data() + nq, nv) : 0;
        const double err =
            error(c, errors.data(), tableau.doubled ? 1 : tableau.errors, size0.data(), size1.data(), noise);
        c.h = next_step(c, h, err);
        if (!(err <= 1)) {
          ++c.rejected;
          if (!std::isfinite(err)) stands_ = false;
          continue;
        }
        c.h = std::max(c.h, c.cut);
      } else {
        for (double x : next.y)
          if (!std::isfinite(x)) throw Trouble();
        if (c.watched && landing(c, next)) throw Trouble();
      }
      if (c.project) {
        const Numbers y = next.y;
        restore(t_next, next.y.data());
        next.low.clear();
        if (tableau.first) {
          difference(y.data(), next.y.data(), move.data());
          size(next.y.data(), size1.data());
          bool tolerated = true;
          if (c.adaptive)
            tolerated = error(c, move.data(), 1, size0.data(), size1.data(), 0) <= 1;
          else
            for (int k = 0; k < n; ++k) tolerated = tolerated && std::fabs(move[k]) <= c.tolerated * (1 + size1[k]);
          if (!tolerated) {
            derivative(t_next, next.y.data(), F.data(), again.data());
            next.carry.assign(F.begin() + nv, F.end());
          }
        }
      }
      if (settle(t_next, next)) c.changes.emplace_back(c.taken + 1, rows_);
    } catch (const Trouble&) {
      give_up();
      return;
    }
    c.t = t_next;
    std::swap(c.state, next);
    std::swap(size0, size1);
    ++c.taken;
    c.ts.push_back(c.t);
    c.ys.insert(c.ys.end(), c.state.y.begin(), c.state.y.end());
    c.zs.insert(c.zs.end(), z.begin(), z.begin() + ng);
    c.weakest.push_back(weakest);
    if (c.watched) c.before = std::sqrt(weakest), c.usual = std::max(c.usual, c.before);
    if (c.watched && c.adaptive && c.before < c.zone * c.usual) return;  // Python looks ahead
    if (!(std::chrono::duration<double>(Clock::now() - started).count() <= c.seconds)) return;
  }
}

}  // namespace mbdae
