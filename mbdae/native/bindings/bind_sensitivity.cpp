// Bindings of tangents and adjoints of steps, and of their parameters.
#include "bindings/py_core.hpp"
#include "sensitivity/trajectory_segment.hpp"

namespace mbdae {

namespace {

struct PyParameters {
  const PyCore* core;
  std::unique_ptr<ParameterPartials> partials;
};

// Laws, or rows with their drivers, perturbed by a parameter.
struct PerturbedElements {
  double weight = 0;
  Anchors pairs;
  std::vector<Law> laws;
  std::vector<Row> rows;
  std::vector<Driver> drivers;

  FIELDS(weight, pairs, laws, rows, drivers)
};

struct ChangedElements {
  int parameter = 0;
  std::vector<int> at;  // indices of the laws' states, or of the rows
  std::vector<PerturbedElements> laws, rows;
  std::vector<ModalBody> bodies;  // rates of their data
  Vector gravity;                 // rate of gravity; empty: none

  FIELDS(parameter, at, laws, rows, bodies, gravity)
};

void check_components(const std::vector<ModelComponent>& components, const Index2System& s) {
  for (const ModelComponent& x : components)
    if (x.kind == ModelComponent::inertia || x.kind == ModelComponent::placement) {
      check_indices({x.id}, s.tree.joints, "joint"), check_indices({x.id - 1}, s.tree.joints, "joint");
    } else {
      const size_t pairs = x.of_law ? s.law_pairs().size() : s.constraints.pairs.size();
      check_indices({x.id}, x.kind == ModelComponent::frame ? static_cast<int>(pairs) : 1, "pair");
    }
}

ChangedElement changed_element(ChangedElements x, const Index2System& s) {
  ChangedElement out;
  out.parameter = x.parameter, out.indices = x.at;
  check_indices(x.at, x.laws.empty() ? s.ng : s.ns, x.laws.empty() ? "row" : "state");
  for (PerturbedElements& p : x.laws) {
    check_anchors(p.pairs, s.tree.frames), check_laws(p.laws, p.pairs.size());
    std::vector<Pair> pairs;
    for (const auto& [a, b] : p.pairs) pairs.emplace_back(a, b, s.tree.supports());
    out.laws.emplace_back(p.weight, std::move(pairs), std::move(p.laws));
  }
  for (PerturbedElements& p : x.rows) {
    if (p.rows.size() != x.at.size()) reject("perturbed rows must be as many as the rows that change");
    check_anchors(p.pairs, s.tree.frames), check_rows(p.rows, p.pairs.size());
    check_drivers(p.drivers, p.rows.size());
    out.rows.push_back(
        {p.weight, std::make_unique<Constraints>(s.tree, std::move(p.rows), p.pairs, std::move(p.drivers))});
  }
  check_bodies(x.bodies, s.tree.nq, s.nv, s.tree.joints);
  out.bodies = s.tree.bind(std::move(x.bodies)), out.gravity = std::move(x.gravity);
  if (!out.gravity.empty() && out.gravity.size() != 3) reject("gravity must have three components");
  return out;
}

PyParameters bind_parameters(PyCore& c, int count, const nb::list& component_list, const nb::list& direction_list,
                             const nb::list& changed_list) {
  const CoreLock lock(c);
  Index2System& s = c.core->system;
  if (s.formulation == Formulation::index1) reject("tangents and adjoints require formulation index 2 or GGL");
  if (count < 0) reject("the number of parameters must not be negative");
  PyDescriptionReader reader = c.reader();
  auto components = reader.read<std::vector<ModelComponent>>(component_list);
  auto directions = reader.read<std::vector<Direction>>(direction_list);
  check_components(components, s);
  for (const Direction& d : directions) {
    check_indices({d.parameter}, count, "parameter");
    check_indices({d.component}, static_cast<int>(components.size()), "component");
    if (static_cast<int>(d.x.size()) != size_of(components[d.component].kind, s.nv))
      reject("the size of a direction must be that of its model component");
  }
  std::vector<ChangedElement> changed;
  for (ChangedElements& x : reader.read<std::vector<ChangedElements>>(changed_list)) {
    check_indices({x.parameter}, count, "parameter");
    changed.push_back(changed_element(std::move(x), s));
  }
  return {&c, std::make_unique<ParameterPartials>(s, count, std::move(components), std::move(directions),
                                                  std::move(changed))};
}

// A trajectory segment whose data are checked; the arrays live as long as the call.
struct CheckedSegment {
  CheckedSegment(PyCore& c, nb::handle method, bool halved, bool project, const Array& t, const Array& y,
                 const PyParameters* p = nullptr)
      : ny(c.core->system.ny),
        nodes(t.size()),
        ts(t.data(), t.data() + nodes),
        ys(checked_vector(y, nodes * c.core->system.length, "y")),
        segment{nb::isinstance<Tableau>(method) ? nb::cast<const Tableau*>(method) : nullptr,
                nb::isinstance<Radau>(method) ? nb::cast<const Radau*>(method) : nullptr,
                halved,
                project,
                nodes - 1,
                ts.data(),
                ys.data()},
        nc(carry_size(c.core->system, segment)) {
    if (!nodes) reject("a segment must have a node");
    if (!segment.tableau && !segment.radau) reject("the method of a segment must be a tableau or Radau");
    if (c.core->system.formulation == Formulation::index1)
      reject("tangents and adjoints require formulation index 2 or GGL");
    if (p && p->core != &c) reject("the parameters belong to another core");
    if ((p || project || segment.radau) && !c.core->system.tree.expanded())
      reject("partials require the expanded tree");
  }
  const size_t ny, nodes;
  const Vector ts, ys;
  const TrajectorySegment segment;
  const size_t nc;
};

template <class F>
bool succeeds(PyCore& c, F&& compute) {
  bool failed = false;
  c.core->system.point.invalidate();
  run_unlocked(c, [&] {
    try {
      compute(c.core->system);
    } catch (const FallBackToPython&) {
      failed = true;
    }
  });
  return !failed;
}

std::optional<std::tuple<Out, std::vector<int>, size_t, Out>> recompute_steps(PyCore& c, nb::handle a, bool halved,
                                                                              const Run& run, const Array& t,
                                                                              const Array& y, const Array& carry,
                                                                              double same_state, double agreement) {
  const CoreLock lock(c);
  const CheckedSegment x(c, a, halved, run.project, t, y);
  if (x.segment.radau) reject("steps of a collocation method cannot be recomputed: it has no carry");
  const RepeatTolerances settings{run.adaptive, run.control, run.tolerated_move, run.tiny, same_state, agreement};
  const size_t sizes = settings.control.atol.size();
  if (settings.adaptive && sizes != 1 && sizes != static_cast<size_t>(c.core->system.controlled_components()))
    reject("atol has the wrong length");
  Recomputed out;
  out.carries = checked_vector(carry, x.nc, "carry"), out.carries.resize(x.nodes * x.nc);
  if (!succeeds(c, [&](Index2System& s) { recompute(s, x.segment, settings, out); })) return std::nullopt;
  return std::make_tuple(array(out.carries, {x.nodes, x.nc}), out.restarted, out.steps, vector(out.end));
}

// Use a Python function for the partials of friction, for the lifetime of this object.
class FrictionPartialsScope {
 public:
  FrictionPartialsScope(PyCore& c, ParameterPartials& p, const nb::object& f) : p_(p) {
    if (f.is_none()) return;
    p.friction = [f = f.ptr(), interrupted = &c.callbacks->interrupted](
                     const Vector& q, const Vector& v, const Vector& lam, Vector& K, Vector& D, Vector& P) {
      call_python(f, interrupted, {{q.data(), q.size()}, {v.data(), v.size()}, {lam.data(), lam.size()}}, {&K, &D, &P});
    };
  }
  ~FrictionPartialsScope() { p_.friction = nullptr; }
  FrictionPartialsScope(const FrictionPartialsScope&) = delete;

 private:
  ParameterPartials& p_;
};

std::optional<std::pair<Out, Out>> adjoint_of_steps(PyCore& c, PyParameters& p, nb::handle a, bool halved, bool project,
                                                    const Array& t, const Array& y, const Array& carries,
                                                    const Array& extra, const Array& bar, const nb::object& friction) {
  const CoreLock lock(c);
  const FrictionPartialsScope scope(c, *p.partials, friction);
  const CheckedSegment x(c, a, halved, project, t, y, &p);
  const size_t width = x.ny + x.nc, costs = bar.size() / width, k = p.partials->count();
  const Vector carries_in = checked_vector(carries, x.nodes * x.nc, "carries");
  const Vector extra_in = checked_vector(extra, x.nodes * costs * width, "extra");
  Vector y_bar = checked_vector(bar, costs * width, "bar"), p_bar(costs * k);
  if (!succeeds(c, [&](Index2System& s) {
        adjoint(s, *p.partials, x.segment, carries_in.data(), static_cast<int>(costs), extra_in.data(), y_bar.data(),
                p_bar.data());
      }))
    return std::nullopt;
  return std::make_pair(array(y_bar, {costs, width}), array(p_bar, {costs, k}));
}

std::optional<Out> tangent_of_steps(PyCore& c, PyParameters& p, nb::handle a, bool halved, bool project, const Array& t,
                                    const Array& y, const Array& carries, const Array& first, const Array& dp,
                                    const std::optional<Array>& dh, const nb::object& friction) {
  const CoreLock lock(c);
  const FrictionPartialsScope scope(c, *p.partials, friction);
  const CheckedSegment x(c, a, halved, project, t, y, &p);
  const size_t width = x.ny + x.nc, d = first.size() / width;
  const Vector carries_in = checked_vector(carries, x.nodes * x.nc, "carries");
  const Vector dp_in = checked_vector(dp, d * p.partials->count(), "dp");
  const Vector start = checked_vector(first, d * width, "first");
  const Vector dh_in = dh ? checked_vector(*dh, d, "dh") : Vector();
  Vector tangents(x.nodes * d * width);
  if (!succeeds(c, [&](Index2System& s) {
        tangent(s, *p.partials, x.segment, carries_in.data(), static_cast<int>(d), dp_in.data(),
                dh ? dh_in.data() : nullptr, start.data(), tangents.data());
      }))
    return std::nullopt;
  return array(tangents, {x.nodes, d, width});
}

// Project y, or v alone, onto the closures; return the point and its partials (ny, ny + k).
std::optional<std::pair<Out, Out>> projection(PyCore& c, PyParameters& p, double t, const Array& y, bool positions) {
  const CoreLock lock(c);
  Index2System& s = c.core->system;
  if (p.core != &c) reject("the parameters belong to another core");
  if (!s.tree.expanded()) reject("partials require the expanded tree");
  const size_t ny = s.ny, k = p.partials->count(), d = ny + k;
  Vector projected = checked_vector(y, s.length, "y"), tangents(d * ny, 0.0), dp(d * k, 0.0);
  for (size_t i = 0; i < ny; ++i) tangents[i * ny + i] = 1;
  for (size_t i = 0; i < k; ++i) dp[(ny + i) * k + i] = 1;
  if (!succeeds(c, [&](Index2System&) {
        ProjectionSensitivity sensitivity(s, *p.partials, true);
        sensitivity.take(t, projected.data(), positions);
        sensitivity.forward(static_cast<int>(d), tangents.data(), ny, dp.data(), nullptr);
      }))
    return std::nullopt;
  return std::make_pair(vector(projected), array(tangents, {d, ny}));
}

}  // namespace

void bind_sensitivity(nb::module_& m, nb::class_<PyCore>& core) {
  using nb::arg;
  nb::class_<PyParameters>(m, "Parameters",
                           "The parameters of a mechanism with respect to which steps are differentiated.");
  core.def("bind_parameters", bind_parameters, nb::keep_alive<0, 1>(), arg("count"), arg("components"),
           arg("directions"), arg("changed"), "Set how parameters change model components, laws and rows.")
      .def("recompute", recompute_steps, arg("method"), arg("halved"), arg("run"), arg("t"), arg("y"), arg("carry"),
           arg("same_state"), arg("agreement"),
           "Return the carry at each node (m + 1, nc), whether it was restarted there, the number of steps that could "
           "be "
           "repeated,\n"
           "and the state after them; or None.")
      .def("adjoint", adjoint_of_steps, arg("parameters"), arg("method"), arg("halved"), arg("project"), arg("t"),
           arg("y"), arg("carries"), arg("extra"), arg("bar"), arg("friction") = nb::none(),
           "Return the cotangents of y and carry (costs, ny + nc) at the first node, and of parameters (costs, k), or "
           "None;\n"
           "extra (m + 1, costs, ny + nc) are added at the inner nodes.")
      .def("tangent", tangent_of_steps, arg("parameters"), arg("method"), arg("halved"), arg("project"), arg("t"),
           arg("y"), arg("carries"), arg("first"), arg("dp"), arg("dh") = nb::none(), arg("friction") = nb::none(),
           "Return tangents of y and carry at all nodes, (m + 1, d, ny + nc), or None; dh (d,) are those of the step\n"
           "sizes. friction: (q, v, lam) -> K (n, nv), D (n, n), P (k, n) of friction that depends on multipliers.")
      .def("projection", projection, arg("parameters"), arg("t"), arg("y"), arg("positions"),
           "Project y, or v alone, onto the closures; return the point and its partials with "
           "respect to\n"
           "y and the parameters, transposed, (ny + k, ny); or None.");
}

}  // namespace mbdae
