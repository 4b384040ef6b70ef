#include "description.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

namespace {

nb::object argument(const double* x, size_t n) {  // a copy: a Python function may keep it, but not change it
  auto* data = new double[n];
  std::copy(x, x + n, data);
  nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, const double>(data, {n}, owner));
}

// Call Python: what it raises ends the core's part of a run, and Python, where it is called again, says why.
template <class F>
void guarded(bool* interrupted, F&& f) {
  nb::gil_scoped_acquire gil;
  try {
    f();
  } catch (nb::python_error& e) {
    if (!e.matches(PyExc_Exception)) *interrupted = true, e.restore();  // Ctrl-C, exit: raised again at the end
    throw Trouble();
  } catch (const nb::cast_error&) {
    throw Trouble();
  }
}

Anchor anchor(const nb::tuple& x, int joints) {
  Anchor a;
  if (x.size() != 3) refuse("a frame is a joint, a rotation and a position");
  a.joint = nb::cast<int>(x[0]);
  const auto R = nb::cast<Numbers>(x[1]), p = nb::cast<Numbers>(x[2]);
  if (a.joint < 0 || a.joint >= joints || R.size() != 9 || p.size() != 3) refuse("a frame does not fit the model");
  std::copy(R.begin(), R.end(), a.R), std::copy(p.begin(), p.end(), a.p);
  return a;
}

}  // namespace

Signal signal(const nb::dict& d, Callbacks& callbacks) {
  static const std::map<std::string, Signal::Kind> kinds = {
      {"constant", Signal::constant}, {"harmonic", Signal::harmonic}, {"polynomial", Signal::polynomial},
      {"pieces", Signal::pieces},     {"steps", Signal::steps},       {"python", Signal::python}};
  Signal s;
  s.kind = kind(kinds, get<std::string>(d, "kind"));
  if (s.kind == Signal::python) {
    s.call = [f = callbacks.add(d), interrupted = &callbacks.interrupted](double t, int k) {
      double out = NAN;
      guarded(interrupted, [&] { out = nb::cast<double>(nb::handle(f)(t, k)); });
      return out;
    };
    return s;
  }
  s.a = get<Numbers>(d, "a");
  if (d.contains("b")) s.b = get<Numbers>(d, "b");
  const size_t n = s.a.size();
  bool fits = n >= 1;
  if (s.kind == Signal::harmonic) fits = n == 4;
  if (s.kind == Signal::steps) fits = n >= 1 && s.b.size() == n;
  if (s.kind == Signal::pieces) {
    s.degree = get<int>(d, "degree");
    fits = s.degree >= 0 && s.b.size() >= 2 && n == (s.b.size() - 1) * (static_cast<size_t>(s.degree) + 1);
  }
  if (!fits) refuse("the numbers of a function of time do not fit its kind");
  return s;
}

std::vector<std::pair<Anchor, Anchor>> pairs(const nb::list& list, int joints) {
  std::vector<std::pair<Anchor, Anchor>> out;
  for (nb::handle h : list) {
    auto x = nb::cast<nb::tuple>(h);
    if (x.size() != 2) refuse("a pair has two frames");
    out.emplace_back(anchor(nb::cast<nb::tuple>(x[0]), joints), anchor(nb::cast<nb::tuple>(x[1]), joints));
  }
  return out;
}

Row row(const nb::dict& d, const Sizes& n, int pair_count) {
  Row r;
  const RowKind k = kind(ROW_KINDS, get<std::string>(d, "kind"));
  r.kind = k.kind, r.has_a = k.a, r.has_b = k.b;
  if (r.kind == Row::coordinate) {
    const auto joints = get<std::vector<std::vector<int>>>(d, "joints");
    if (joints.empty() || joints.size() > 2) refuse("a coordinate row has one joint or two");
    for (size_t i = 0; i < joints.size(); ++i) {
      if (joints[i].size() != 3) refuse("a joint is given by iq, nq, iv");
      r.iq[i] = joints[i][0], r.nq[i] = joints[i][1], r.iv[i] = joints[i][2];
      within({r.iq[i], r.iq[i] + r.nq[i] - 1}, n.nq, "coordinate"), within({r.iv[i]}, n.nv, "velocity");
      if (r.nq[i] != 1 && r.nq[i] != 2) refuse("a joint of one velocity has one coordinate or two");
    }
    r.c = get<Numbers>(d, "c"), r.period = get<double>(d, "period");
    return r;
  }
  r.pair = get<int>(d, "pair");
  within({r.pair}, pair_count, "pair");
  auto axis = [&](const char* key, double* out) {
    const auto x = get<Numbers>(d, key);
    if (x.size() != 3) refuse("axes have three numbers");
    std::copy(x.begin(), x.end(), out);
  };
  if (k.a) axis("a", r.a);
  if (k.b) axis("b", r.b);
  if (k.length) r.length = get<double>(d, "length");
  return r;
}

Law law(const nb::dict& d, const Sizes& n, int ns, int pair_count, int& pair, Callbacks& callbacks) {
  static const std::map<std::string, Law::Kind> kinds = {{"damping", Law::damping},
                                                         {"friction", Law::friction},
                                                         {"spring", Law::spring},
                                                         {"curve", Law::curve},
                                                         {"torque", Law::torque},
                                                         {"pd", Law::pd},
                                                         {"pid", Law::pid},
                                                         {"resistance", Law::resistance},
                                                         {"motor", Law::motor},
                                                         {"held", Law::held},
                                                         {"spring_damper", Law::spring_damper},
                                                         {"bushing", Law::bushing},
                                                         {"wrench", Law::wrench},
                                                         {"python", Law::python},
                                                         {"actuator", Law::actuator}};
  Law out;
  out.kind = kind(kinds, get<std::string>(d, "kind"));
  auto maybe = [&](const char* key, auto& target) {
    if (d.contains(key)) target = nb::cast<std::decay_t<decltype(target)>>(d[key]);
  };
  maybe("iq", out.iq), maybe("iv", out.iv), maybe("a", out.a), maybe("state", out.state), maybe("states", out.states);
  maybe("flag", out.flag), maybe("steady", out.steady);
  pair = -1;
  maybe("pair", pair);
  if (d.contains("signals"))
    for (nb::handle h : nb::cast<nb::list>(d["signals"]))
      out.signals.push_back(signal(nb::cast<nb::dict>(h), callbacks));
  within(out.iq, n.nq, "coordinate"), within(out.iv, n.nv, "velocity");
  if (out.state < 0 || out.states < 0 || out.states > ns || out.state > ns - out.states) refuse("states out of range");
  struct Needs {
    size_t a, signals, iv;
    int states;
    bool pair;
  };
  const size_t nv = n.nv, any = 0;
  const std::map<Law::Kind, Needs> needs = {
      {Law::damping, {nv, 0, 0, 0, false}},     {Law::friction, {nv + 1, 0, 0, 0, false}},
      {Law::spring, {3, 0, any, 0, false}},     {Law::curve, {3, 1, any, 0, false}},
      {Law::torque, {1, any, 1, 0, false}},     {Law::pd, {3, 1, 1, 0, false}},
      {Law::pid, {3, 1, 1, 1, false}},          {Law::resistance, {2, 1, 1, 0, false}},
      {Law::motor, {3, 1, 1, 1, false}},        {Law::held, {0, 0, 0, 0, false}},
      {Law::spring_damper, {3, 1, 0, 0, true}}, {Law::bushing, {12, 0, 0, 0, true}},
      {Law::wrench, {0, 6, 0, 0, true}},        {Law::python, {0, 0, 0, 0, false}},
      {Law::actuator, {0, 0, 0, 0, false}}};
  const Needs& need = needs.at(out.kind);
  const bool spring = out.kind == Law::spring || out.kind == Law::curve;
  const bool position = out.kind == Law::pd || out.kind == Law::pid;
  bool fits = out.a.size() >= need.a && out.signals.size() >= need.signals && out.iv.size() >= need.iv;
  fits = fits && out.states >= need.states && (!need.pair || (pair >= 0 && pair < pair_count));
  fits = fits && (!spring || out.iq.size() == out.iv.size()) && (!position || !out.iq.empty());
  if (out.kind == Law::torque) fits = fits && out.iv[0] + out.signals.size() <= nv;
  if (out.kind == Law::held) fits = fits && static_cast<int>(out.iv.size()) <= out.states;
  if (!fits) refuse("the numbers of a force law do not fit its kind");
  if (out.kind == Law::python || out.kind == Law::actuator) {
    const nb::handle f = callbacks.add(d);
    bool* interrupted = &callbacks.interrupted;
    const int nq = n.nq, v = n.nv, k = out.states;
    const bool rates = out.kind == Law::actuator;
    out.call = [=](double t, const double* q, const double* qd, const double* s, double* tau, double* ds) {
      guarded(interrupted, [&] {
        nb::object result =
            rates ? f(t, argument(q, nq), argument(qd, v), argument(s, k)) : f(t, argument(q, nq), argument(qd, v));
        auto add = [](nb::handle x, size_t size, double* out, bool sum) {
          auto a = nb::cast<Array>(x);
          if (a.size() != size) throw Trouble();
          for (size_t i = 0; i < size; ++i) out[i] = a.data()[i] + (sum ? out[i] : 0.0);
        };
        if (!rates) return add(result, v, tau, true);
        auto both = nb::cast<nb::tuple>(result);
        if (both.size() != 2) throw Trouble();
        add(both[0], v, tau, true), add(both[1], k, ds, false);
      });
    };
  }
  return out;
}

}  // namespace mbdae
