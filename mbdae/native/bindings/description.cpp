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

void DescriptionReader::read(nb::handle h, TimeFunction& out) {
  read_fields(h, out, false);
  bool valid = out.kind == TimeFunction::python || out.a.size() == 4;
  if (out.kind == TimeFunction::polynomials)
    valid = out.degree >= 0 && (out.input < 0 || (out.degree == 1 && out.b.size() == 1)) && !out.b.empty() &&
            out.a.size() == out.b.size() * (static_cast<size_t>(out.degree) + 1);
  if (!valid) reject("the numbers of a function of time do not fit its kind");
  if (out.kind != TimeFunction::python) return;
  out.call = [f = callbacks_.add(nb::cast<nb::dict>(h), "call"), interrupted = &callbacks_.interrupted](double t,
                                                                                                        int k) {
    double x = NAN;
    guarded(interrupted, [&] { x = nb::cast<double>(f(t, k)); });
    return x;
  };
}

void DescriptionReader::read(nb::handle h, std::shared_ptr<const Profile>& out) {
  auto p = std::make_shared<Profile>();
  read_fields(h, *p, true);
  const size_t n = p->coefficients.size(), polynomials = p->starts.size() - 1;
  if (p->starts.size() < 2 || p->samples.empty() || p->degree < 0 || n < 2 || n % 2 ||
      !(p->starts.back() > p->starts[0]) || !std::is_sorted(p->starts.begin(), p->starts.end()) ||
      (!p->harmonic && n != 2 * polynomials * (static_cast<size_t>(p->degree) + 1)))
    reject("the numbers of a profile do not fit");
  for (double s : p->samples) {
    const Profile::Point x = p->at(s);
    p->points.insert(p->points.end(), x.c, x.c + 2);
  }
  out = p;
}

std::shared_ptr<const RowFunction> DescriptionReader::row_function(const nb::dict& d) {
  auto out = std::make_shared<RowFunction>();
  read_fields(d, *out, true);
  check_indices(out->iq, n_.nq, "coordinate"), check_indices(out->iv, n_.nv, "velocity");
  const auto select = [](const double* x, const std::vector<int>& indices) {
    Numbers selected;
    for (int i : indices) selected.push_back(x[i]);
    return selected;
  };
  const auto of_q = [&](const char* key) {
    return [=, f = callbacks_.add(d, key), iq = out->iq, interrupted = &callbacks_.interrupted](const double* q,
                                                                                                Numbers& to) {
      const Numbers x = select(q, iq);
      call_python(f, interrupted, {{x.data(), x.size()}}, {&to});
    };
  };
  out->value = of_q("value"), out->partials = of_q("partials");
  out->bias = [=, f = callbacks_.add(d, "bias"), iq = out->iq, iv = out->iv, interrupted = &callbacks_.interrupted](
                  const double* q, const double* v) {
    const Numbers x = select(q, iq), rates = select(v, iv);
    Numbers to(1);
    call_python(f, interrupted, {{x.data(), x.size()}, {rates.data(), rates.size()}}, {&to});
    return to[0];
  };
  return out;
}

void DescriptionReader::read(nb::handle h, Row& out) {
  const auto d = nb::cast<nb::dict>(h);
  out.positional = ROW_KINDS.at(read<Row::Kind>(item(d, "kind"))).positional;
  read_fields(d, out, false);
  for (const std::string& key : split_names(ROW_KINDS.at(out.kind).needs)) {
    item(d, key.c_str());
    out.has_a = out.has_a || key == "a", out.has_b = out.has_b || key == "b";
  }
  if (out.kind == Row::function) out.python = row_function(d);
  if (!out.between_joints()) return;
  const size_t n = out.joints.size(), most = out.kind == Row::sum ? n : out.kind == Row::ratio ? 3 : 2;
  const size_t least = out.kind == Row::function ? 0 : out.kind == Row::coordinate || out.kind == Row::ratio ? 1 : 2;
  if (n < least || n > most) reject("a row between joints has one to three of them");
  for (const RowJoint& j : out.joints) {
    if (j.nq != 1 && j.nq != 2) reject("a joint of one velocity has one coordinate or two");
    check_indices({j.iq}, n_.nq - j.nq + 1, "coordinate"), check_indices({j.iv}, n_.nv, "velocity");
  }
  if (out.kind == Row::sum && out.c.size() != n) reject("a sum has a coefficient for each joint");
  if (out.kind == Row::curved && out.law.kind == TimeFunction::python) reject("a law is polynomials or a harmonic");
}

void DescriptionReader::check_states(int first, int count) const {
  if (first < 0 || count < 0 || count > states_ || first > states_ - count) reject("states out of range");
}

void DescriptionReader::read(nb::handle h, Law& out) {
  const auto d = nb::cast<nb::dict>(h);
  const auto name = nb::cast<std::string>(item(d, "kind"));
  if (!(out.kind = law_kind(name))) throw UnknownKind(name);
  read_fields(d, out, false);
  check_states(out.state, out.states);
  bool* const interrupted = &callbacks_.interrupted;
  if (d.contains("call")) {
    out.call = function(callbacks_.add(d, "call"), n_, out.states, interrupted);
    out.partials = partials(callbacks_.add(d, "partials"), n_, out.states, interrupted);
    out.time_rate = partials(callbacks_.add(d, "time_rate"), n_, out.states, interrupted);
  }
  if (!out.kind->is_valid(out, n_)) reject("the numbers of a force law do not fit its kind");
}

void DescriptionReader::read(nb::handle h, SampledController& out) {
  const auto d = nb::cast<nb::dict>(h);
  read_fields(d, out, read<SampledController::Kind>(item(d, "kind")) == SampledController::pid);
  if (!(out.rate > 0) || !std::isfinite(out.offset) || !(out.coincide >= 0)) reject("a rate is positive");
  if (out.states < 1) reject("states out of range");
  check_states(out.state, out.states);
  if (out.kind == SampledController::pid) {
    check_indices({out.x, out.v}, n_.nq + n_.nv, "coordinate");
    if (out.a.size() != 3 || out.states > 2) reject("a PID controller has three gains");
    return;
  }
  const Law::Call call = function(callbacks_.add(d, "call"), n_, out.states, &callbacks_.interrupted);
  out.call = [call, nv = n_.nv](double t, const double* q, const double* v, const double* s, double* after) {
    Numbers none(nv);
    call(t, q, v, s, none.data(), after);
  };
}

void check_indices(const std::vector<int>& x, int n, const char* what) {
  for (int i : x)
    if (i < 0 || i >= n) reject(std::string(what) + " out of range");
}

void check_anchors(const Anchors& pairs, int joints) {
  for (const auto& [a, b] : pairs) check_indices({a.joint, b.joint}, joints, "joint of a frame");
}

void check_rows(const std::vector<Row>& rows, size_t pairs) {
  for (const Row& row : rows)
    if (!row.between_joints()) check_indices({row.pair}, static_cast<int>(pairs), "pair");
}

void check_laws(const std::vector<Law>& laws, size_t pairs) {
  for (const Law& law : laws)
    if (law.pair != -1) check_indices({law.pair}, static_cast<int>(pairs), "pair");
}

void check_drivers(const std::vector<Driver>& drivers, size_t rows) {
  for (const Driver& driver : drivers) check_indices({driver.row}, static_cast<int>(rows), "row");
}

static void check_body(const ModalBody& b, int nq, int nv, int joints) {
  check_indices({b.joint}, joints, "joint of a flexible body");
  if (b.modes < 1 || b.modes > nv) reject("modes out of range");
  check_indices({b.iq}, nq - b.modes + 1, "mode"), check_indices({b.iv}, nv - b.modes + 1, "mode");
  const size_t k = b.modes;
  bool valid = b.C.size() == 3 * k && b.C2.size() == 3 * k * k && b.H0.size() == 3 * k && b.Mq.size() == k * k && b.Hj.size() == 3 * k * k &&
               b.I1.size() == 6 * k && b.I2.size() == 6 * k * k;
  const size_t cube = b.Mq1.size();
  valid = valid && (cube == 0 || cube == k * k * k) && b.H2.size() == 3 * cube && b.Mq2.size() == k * cube;
  for (const ModalNode& x : b.nodes) valid = valid && x.Phi.size() == 3 * k && x.Psi.size() == 3 * k && x.Phi2.size() == 3 * k * k;
  if (!valid) reject("the numbers of a flexible body do not fit its modes");
}

void check_bodies(const std::vector<ModalBody>& bodies, int nq, int nv, int joints) {
  for (const ModalBody& body : bodies) check_body(body, nq, nv, joints);
}

void check(const Description& d, const Sizes& n, const Tolerances& tolerances) {
  if (static_cast<int>(d.angular.size()) != n.nv || d.probe.size() != d.angular.size())
    reject("sizes do not fit the model");
  if (d.flat && n.nq != n.nv) reject("a flat manifold has nq = nv");
  if (tolerances.row_scales.size() != d.rows.size() || static_cast<int>(tolerances.q_scales.size()) != n.nq ||
      static_cast<int>(tolerances.coordinate_scales.size()) != n.nv)
    reject("as many scales as rows, coordinates and velocities");
  if (!std::isfinite(d.alpha) || !std::isfinite(d.beta)) reject("alpha and beta are finite");
  std::vector<int> order(d.order);
  std::sort(order.begin(), order.end());
  for (size_t i = 0; i < order.size(); ++i)
    if (order[i] != static_cast<int>(i)) reject("the order of elimination is 0, 1, ... in some order");
  if (order.size() != d.rows.size()) reject("as many positions in the order of elimination as rows");
  size_t frames = n.joints;
  check_bodies(d.flexible, n.nq, n.nv, n.joints);
  for (const ModalBody& body : d.flexible) frames += body.nodes.size();
  check_anchors(d.pairs, static_cast<int>(frames)), check_anchors(d.law_pairs, static_cast<int>(frames));
  check_rows(d.rows, d.pairs.size()), check_laws(d.laws, d.law_pairs.size());
  check_drivers(d.drivers, d.rows.size());
  for (const GroupJoint& b : d.group_joints) {
    const int size = b.kind == GroupJoint::se3 ? 6 : 3;
    check_indices({b.iv}, n.nv - size + 1, "group_joints"), check_indices({b.iq}, n.nq - size, "group_joints");
  }
}

}  // namespace mbdae
