#include "bindings/description.hpp"

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

// Call Python: an exception ends the core's part of a run, and Python, which calls the function again, reports it.
template <class F>
void guarded(bool* interrupted, F&& f) {
  nb::gil_scoped_acquire gil;
  try {
    f();
  } catch (nb::python_error& e) {
    if (!e.matches(PyExc_Exception)) {  // Ctrl-C, exit: raised again at the end
      *interrupted = true, e.restore();
      throw Interrupted();
    }
    throw FallBackToPython();
  } catch (const nb::cast_error&) {
    throw FallBackToPython();
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

// A function (t, q, v, s) -> (tau, s'), s (k,); tau is added.
Law::Call function(nb::handle f, const Sizes& n, int k, bool* interrupted) {
  return [=](double t, const double* q, const double* v, const double* s, double* tau, double* ds) {
    guarded(interrupted, [&] {
      const nb::tuple both(f(t, argument(q, n.nq), argument(v, n.nv), argument(s, k)));
      if (both.size() != 2) throw FallBackToPython();
      const auto force = nb::cast<Array>(both[0]);
      if (force.size() != static_cast<size_t>(n.nv)) throw FallBackToPython();
      for (int i = 0; i < n.nv; ++i) tau[i] += force.data()[i];
      if (!k) return;
      const auto rate = nb::cast<Array>(both[1]);
      if (rate.size() != static_cast<size_t>(k)) throw FallBackToPython();
      std::copy(rate.data(), rate.data() + k, ds);
    });
  };
}

// A function (t, q, v, s) -> partials of (tau, s') and of the power, one row or number for each of them.
Law::EquationPartials partials(nb::handle f, const Sizes& n, int k, bool* interrupted) {
  return [=](double t, const double* q, const double* v, const double* s, Numbers& out) {
    guarded(interrupted, [&] {
      const auto known = nb::cast<Array>(f(t, argument(q, n.nq), argument(v, n.nv), argument(s, k)));
      if (known.size() < out.size()) throw FallBackToPython();
      std::copy(known.data(), known.data() + out.size(), out.begin());
    });
  };
}

}  // namespace

TimeFunction signal(const nb::dict& d, Callbacks& callbacks) {
  static const std::map<std::string, TimeFunction::Kind> kinds = {
      {"pieces", TimeFunction::pieces}, {"harmonic", TimeFunction::harmonic}, {"python", TimeFunction::python}};
  TimeFunction s;
  s.kind = kind(kinds, get<std::string>(d, "kind"));
  if (s.kind == TimeFunction::python) {
    s.call = [f = callbacks.add(d), interrupted = &callbacks.interrupted](double t, int k) {
      double out = NAN;
      guarded(interrupted, [&] { out = nb::cast<double>(nb::handle(f)(t, k)); });
      return out;
    };
    return s;
  }
  s.a = get<Numbers>(d, "a");
  bool fits = s.a.size() == 4;
  if (s.kind == TimeFunction::pieces) {
    s.b = get<Numbers>(d, "b"), s.degree = get<int>(d, "degree");
    s.period = get<double>(d, "period"), s.rise = get<double>(d, "rise");
    fits = s.degree >= 0 && !s.b.empty() && s.a.size() == s.b.size() * (static_cast<size_t>(s.degree) + 1);
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

std::shared_ptr<const Profile> profile(const nb::dict& d) {
  auto p = std::make_shared<Profile>();
  p->harmonic = get<bool>(d, "harmonic"), p->closed = get<bool>(d, "closed"), p->side = get<double>(d, "side");
  p->starts = get<Numbers>(d, "starts"), p->numbers = get<Numbers>(d, "numbers"), p->degree = get<int>(d, "degree");
  p->samples = get<Numbers>(d, "samples");
  const auto search = get<Numbers>(d, "search");
  const size_t n = p->numbers.size(), pieces = p->starts.size() - 1;
  if (p->starts.size() < 2 || p->samples.empty() || search.size() != 3 || p->degree < 0 || n < 2 || n % 2 ||
      !(p->starts.back() > p->starts[0]) || !std::is_sorted(p->starts.begin(), p->starts.end()) ||
      (!p->harmonic && n != 2 * pieces * (static_cast<size_t>(p->degree) + 1)))
    refuse("the numbers of a profile do not fit");
  p->iterations = static_cast<int>(search[0]), p->rounding = search[1], p->sharp = search[2];
  for (double s : p->samples) {
    const Profile::Place x = p->at(s);
    p->points.insert(p->points.end(), x.c, x.c + 2);
  }
  return p;
}

void call_python(nb::handle f, bool* interrupted, const std::vector<std::pair<const double*, size_t>>& in,
                 const std::vector<Numbers*>& out) {
  guarded(interrupted, [&] {
    nb::list given;
    for (const auto& [x, n] : in) given.append(argument(x, n));
    const nb::object found = f(*nb::tuple(given));
    for (size_t i = 0; i < out.size(); ++i) {
      const auto known = nb::cast<Array>(out.size() > 1 ? nb::object(found[i]) : found);
      if (known.size() != out[i]->size()) throw FallBackToPython();
      std::copy(known.data(), known.data() + known.size(), out[i]->begin());
    }
  });
}

static std::shared_ptr<const RowFunction> row_function(const nb::dict& d, const Sizes& n, Callbacks& callbacks) {
  auto out = std::make_shared<RowFunction>();
  out->iq = get<std::vector<int>>(d, "coordinates"), out->iv = get<std::vector<int>>(d, "velocities");
  within(out->iq, n.nq, "coordinate"), within(out->iv, n.nv, "velocity");
  const auto pick = [](const double* x, const std::vector<int>& at) {
    Numbers own;
    for (int i : at) own.push_back(x[i]);
    return own;
  };
  const auto of_q = [&](const char* key) {
    return [=, f = callbacks.add(d, key), iq = out->iq, interrupted = &callbacks.interrupted](const double* q, Numbers& to) {
      const Numbers own = pick(q, iq);
      call_python(f, interrupted, {{own.data(), own.size()}}, {&to});
    };
  };
  out->value = of_q("value"), out->partials = of_q("partials");
  out->bias = [=, f = callbacks.add(d, "bias"), iq = out->iq, iv = out->iv,
               interrupted = &callbacks.interrupted](const double* q, const double* v) {
    const Numbers own = pick(q, iq), rates = pick(v, iv);
    Numbers to(1);
    call_python(f, interrupted, {{own.data(), own.size()}, {rates.data(), rates.size()}}, {&to});
    return to[0];
  };
  return out;
}

Row row(const nb::dict& d, const Sizes& n, int pair_count, Callbacks& callbacks) {
  Row r;
  const RowKind k = kind(ROW_KINDS, get<std::string>(d, "kind"));
  r.kind = k.kind, r.has_a = k.a, r.has_b = k.b, r.positional = k.positional;
  if (r.kind == Row::function) {
    r.python = row_function(d, n, callbacks), r.positional = get<bool>(d, "positional");
    return r;
  }
  if (r.between_joints()) {
    const auto joints = get<std::vector<std::vector<int>>>(d, "joints");
    const size_t few = r.kind == Row::coordinate || r.kind == Row::ratio ? 1 : 2;
    const size_t many = r.kind == Row::sum ? joints.size() : r.kind == Row::ratio ? 3 : 2;
    if (joints.size() < few || joints.size() > many) refuse("a row between joints has one to three of them");
    for (size_t i = 0; i < joints.size(); ++i) {
      if (joints[i].size() != 3) refuse("a joint is given by iq, nq, iv");
      if (i && r.kind == Row::sum) {
        const int q = joints[i][0], nq = joints[i][1], v = joints[i][2];
        within({q, q + nq - 1}, n.nq, "coordinate"), within({v}, n.nv, "velocity");
        if (nq != 1 && nq != 2) refuse("a joint of one velocity has one coordinate or two");
        r.others.push_back({q, nq, v});
        continue;
      }
      r.iq[i] = joints[i][0], r.nq[i] = joints[i][1], r.iv[i] = joints[i][2];
      within({r.iq[i], r.iq[i] + r.nq[i] - 1}, n.nq, "coordinate"), within({r.iv[i]}, n.nv, "velocity");
      if (r.nq[i] != 1 && r.nq[i] != 2) refuse("a joint of one velocity has one coordinate or two");
    }
    r.c = get<Numbers>(d, "c"), r.period = get<double>(d, "period");
    if (r.kind == Row::sum && r.c.size() != joints.size()) refuse("a sum has a coefficient for each joint");
    if (r.kind == Row::curved) {
      const auto law = get<nb::dict>(d, "law");
      const auto fold = get<Numbers>(d, "fold");
      Callbacks none;
      if (get<std::string>(law, "kind") == "python" || fold.size() != 3) refuse("a law is pieces or a harmonic");
      r.law = signal(law, none), std::copy(fold.begin(), fold.end(), r.fold);
    }
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
  if (r.kind == Row::bevel) r.other_length = get<double>(d, "other_length");
  if (r.kind == Row::roller || r.kind == Row::flat_face) r.profile = profile(get<nb::dict>(d, "path"));
  if (r.kind == Row::height || r.kind == Row::grip) {
    r.shape.body = mbdae::kind(BODIES, get<std::string>(d, "body"));
    r.shape.surface = mbdae::kind(SURFACES, get<std::string>(d, "surface"));
    axis("axle", r.shape.axle), axis("squares", r.shape.squares), axis("centre", r.shape.centre);
    const auto x = get<Numbers>(d, "shape");
    if (x.size() != 5) refuse("a shape has five numbers");
    r.shape.rim = x[0], r.shape.tyre = x[1], r.shape.curve = x[2], r.shape.flat = x[3], r.shape.polar = x[4];
  }
  if (r.kind == Row::grip) {
    const auto x = get<Numbers>(d, "share");
    if (x.size() != 2) refuse("a row of grip has two shares");
    std::copy(x.begin(), x.end(), r.share);
  }
  return r;
}

Driver driver(const nb::dict& d, size_t row_count, Callbacks& callbacks) {
  const int at = get<int>(d, "row");
  within({at}, static_cast<int>(row_count), "row");
  return {at, get<bool>(d, "length"), get<bool>(d, "speed"), signal(get<nb::dict>(d, "motion"), callbacks)};
}

SampledController sampler(const nb::dict& d, const Sizes& n, int ns, Callbacks& callbacks) {
  static const std::map<std::string, SampledController::Kind> kinds = {{"pid", SampledController::pid}, {"python", SampledController::python}};
  SampledController out;
  out.kind = kind(kinds, get<std::string>(d, "kind"));
  out.rate = get<double>(d, "rate"), out.offset = get<double>(d, "offset"), out.coincide = get<double>(d, "coincide");
  out.state = get<int>(d, "state"), out.states = get<int>(d, "states");
  if (!(out.rate > 0) || !std::isfinite(out.offset) || !(out.coincide >= 0)) refuse("a rate is positive");
  if (out.states < 1 || out.state < 0 || out.states > ns || out.state > ns - out.states) refuse("states out of range");
  if (out.kind == SampledController::python) {
    const Law::Call call = function(callbacks.add(d), n, out.states, &callbacks.interrupted);
    out.call = [=](double t, const double* q, const double* v, const double* s, double* after) {
      Numbers none(n.nv);
      call(t, q, v, s, none.data(), after);
    };
    return out;
  }
  out.reference = signal(get<nb::dict>(d, "reference"), callbacks);
  out.a = get<Numbers>(d, "a"), out.x = get<int>(d, "x"), out.v = get<int>(d, "v");
  within({out.x, out.v}, n.nq + n.nv, "coordinate");
  if (out.a.size() != 3 || out.states > 2) refuse("a PID controller has three gains");
  return out;
}

FrictionInterface sliding_place(const nb::dict& d, const Constraints& constraints) {
  FrictionInterface out;
  out.kind = kind(SLIDING_KINDS, get<std::string>(d, "kind"));
  out.row = get<int>(d, "row"), out.carried = get<int>(d, "carried"), out.grip = get<std::vector<int>>(d, "grip");
  out.coefficient = get<double>(d, "coefficient"), out.width = get<double>(d, "width");
  const auto axis = get<Numbers>(d, "axis");
  const bool grips = out.kind == FrictionInterface::grips;
  if (axis.size() != 3 || grips == out.grip.empty() || out.grip.size() > 2)
    refuse("a place that slides has an axis, and one that grips one or two rows");
  if (!(out.width > 0) || !(out.coefficient >= 0) || !std::isfinite(out.coefficient)) refuse("friction is positive");
  std::copy(axis.begin(), axis.end(), out.axis);
  const int ng = static_cast<int>(constraints.rows.size());
  if (out.carried < 1 || out.carried > 3) refuse("a force has one to three parts");
  within({out.row, out.row + out.carried - 1}, ng, "row"), within(out.grip, ng, "row");
  out.pair = constraints.rows[out.row].pair;
  if (out.pair < 0) refuse("what slides is between frames");
  for (int k : out.grip)
    if (constraints.rows[k].pair != out.pair) refuse("a grip is between the frames of its height");
  return out;
}

Law law(const nb::dict& d, const Sizes& n, int ns, int pair_count, int& pair, Callbacks& callbacks) {
  Law out;
  const auto name = get<std::string>(d, "kind");
  if (!(out.kind = law_kind(name))) throw UnknownKind(name);
  auto maybe = [&](const char* key, auto& target) {
    if (d.contains(key)) target = nb::cast<std::decay_t<decltype(target)>>(d[key]);
  };
  pair = -1;
  maybe("rows", out.rows), maybe("columns", out.columns), maybe("orders", out.orders), maybe("a", out.a);
  maybe("state", out.state), maybe("states", out.states), maybe("turning", out.turning), maybe("steady", out.steady);
  maybe("pair", pair), maybe("offset", out.offset);
  out.paired = pair >= 0 && pair < pair_count;
  if (d.contains("signals"))
    for (nb::handle h : nb::cast<nb::list>(d["signals"]))
      out.signals.push_back(signal(nb::cast<nb::dict>(h), callbacks));
  if (out.state < 0 || out.states < 0 || out.states > ns || out.state > ns - out.states) refuse("states out of range");
  if (d.contains("call")) out.call = function(callbacks.add(d), n, out.states, &callbacks.interrupted);
  if (d.contains("partials")) out.partials = partials(callbacks.add(d, "partials"), n, out.states, &callbacks.interrupted);
  if (d.contains("time_rate")) {
    out.time_rate = partials(callbacks.add(d, "time_rate"), n, out.states, &callbacks.interrupted);
  }
  if (!out.kind->fits(out, n)) refuse("the numbers of a force law do not fit its kind");
  return out;
}

}  // namespace mbdae
