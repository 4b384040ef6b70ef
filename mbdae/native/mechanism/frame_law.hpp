// Force laws between two frames: a formula of their poses and velocities, differentiated by dual numbers.
#pragma once

#include "mechanism/frames.hpp"
#include "mechanism/laws.hpp"

namespace mbdae {

template <class S>
struct Context {  // arguments of a law besides frames and velocity
  S t;
  const Tolerances& tolerances;
};

// Wrenches on b: conservative, and all other ones.
template <class S, class T>
struct Wrenches {
  Wrench<S> conservative;
  Wrench<T> other;
};

// F::wrenches(law, context, frames, V) returns the Wrenches, F::damped(law) whether they depend on V = V_b - V_a,
// F::potential(law, frames) the potential in J; F::is_valid checks the data.
template <class F>
struct FrameLaw {
  template <class S>
  static Context<S> context(const ForcePoint& p, const S& t) {
    return {t, p.m.tolerances};
  }

  static void add(const Law& law, const ForcePoint& p, const Forces& f) {
    Pair& pair = *law.frames;
    double V[6] = {0, 0, 0, 0, 0, 0}, w[6];
    pair.update_poses(p.m);
    if (F::damped(law)) pair.relative(p.m, p.v, V);
    const auto all = F::wrenches(law, context(p, p.t), frames_of(pair), velocity_of(V));
    read(all.conservative, w, nullptr), pair.generalized_force(p.m, w, 1, f.conservative);
    read(all.other, w, nullptr);
    if (largest(w, 6) != 0) pair.generalized_force(p.m, w, 1, f.other);
  }

  static void partials(const Law& law, const ForcePoint& p, const LawPartials& out) {
    Pair& pair = *law.frames;
    pair.update_poses(p.m);
    const PairPartials pair_partials(p.m, pair, p.v);
    WrenchPartials conservative, other;
    const auto all = F::wrenches(law, context(p, p.t), moving_frames(pair), velocity_of(pair_partials.V));
    read(all.conservative, conservative.F, conservative.Db), read(all.other, other.F, other.Db);
    if (F::damped(law)) {
      other.damp();
      read(F::wrenches(law, context(p, p.t), frames_of(pair), moving_velocity(pair_partials.V)).other, other.F,
           other.C);
    }
    conservative.complete(), out.add(pair_partials, conservative, true);
    if (!other.damped && largest(other.F, 6) == 0 && largest(other.Db, 36) == 0) return;
    other.complete(pair_partials.V), out.add(pair_partials, other, false);
  }

  static void time_rate(const Law& law, const ForcePoint& p, const Forces& f) {
    static const double zero[6] = {0, 0, 0, 0, 0, 0};
    Pair& pair = *law.frames;
    double V[6] = {0, 0, 0, 0, 0, 0}, w[6], rate[6];
    pair.update_poses(p.m);
    if (F::damped(law)) pair.relative(p.m, p.v, V);
    Dual<1> t(p.t);
    t.d[0] = 1;
    const auto all = F::wrenches(law, context(p, t), moving_frames(pair, zero), velocity_of(V));
    read(all.conservative, w, rate), pair.generalized_force(p.m, rate, 1, f.conservative);
    read(all.other, w, rate), pair.generalized_force(p.m, rate, 1, f.other);
  }

  static double potential(const Law& law, const ForcePoint& p) {
    law.frames->update_poses(p.m);
    return F::potential(law, frames_of(*law.frames));
  }
};

template <class F>
constexpr LawKind frame_law() {
  return {F::is_valid, FrameLaw<F>::add, FrameLaw<F>::partials, FrameLaw<F>::potential, FrameLaw<F>::time_rate};
}

}  // namespace mbdae
