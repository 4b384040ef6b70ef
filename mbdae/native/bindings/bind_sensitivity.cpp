// Tangents and adjoints of steps, and their parameters; for type checkers: mbdae/_native.pyi.
#include <nanobind/stl/optional.h>

#include "bindings/py_core.hpp"
#include "sensitivity/trajectory_segment.hpp"

namespace mbdae {

namespace {

struct PyParameters {
  const PyCore* core;
  std::unique_ptr<Parameters> partials;
};

std::vector<ModelComponent> stuff(const nb::list& list, const Index2System& s) {
  static const std::map<std::string, ModelComponent::Of> kinds = {{"inertia", ModelComponent::inertia}, {"place", ModelComponent::place},
                                                         {"frame", ModelComponent::frame}, {"gravity", ModelComponent::gravity},
                                                         {"armature", ModelComponent::armature}};
  std::vector<ModelComponent> out;
  for (nb::handle h : list) {
    const auto x = nb::cast<nb::tuple>(h);
    if (x.size() != 4) refuse("stuff is a kind, a number, whether it is of a law, and of a pair's second frame");
    ModelComponent one{kind(kinds, nb::cast<std::string>(x[0])), nb::cast<int>(x[1]), nb::cast<bool>(x[2]), nb::cast<bool>(x[3])};
    const auto& pairs = one.of_law ? s.law_pairs() : s.constraints.pairs;
    if (one.of == ModelComponent::inertia || one.of == ModelComponent::place) {
      within({one.at - 1}, s.mechanics.joints - 1, "joint");
    } else {
      within({one.at}, one.of == ModelComponent::frame ? static_cast<int>(pairs.size()) : 1, "pair");
    }
    out.push_back(one);
  }
  return out;
}

std::vector<Direction> directions(const nb::list& list, const std::vector<ModelComponent>& of, int count, int nv) {
  std::vector<Direction> out;
  for (nb::handle h : list) {
    const auto x = nb::cast<nb::tuple>(h);
    if (x.size() != 3) refuse("a direction is a parameter, stuff and numbers");
    Direction d{nb::cast<int>(x[0]), nb::cast<int>(x[1]), nb::cast<Numbers>(x[2])};
    within({d.parameter}, count, "parameter"), within({d.stuff}, static_cast<int>(of.size()), "stuff");
    if (static_cast<int>(d.x.size()) != size_of(of[d.stuff].of, nv)) refuse("a direction does not fit");
    out.push_back(std::move(d));
  }
  return out;
}

PerturbedLaws near_laws(const nb::tuple& x, const Sizes& n, int states, const Index2System& s, Callbacks& callbacks) {
  if (x.size() != 3) refuse("laws nearby are a weight, pairs and laws");
  std::vector<Pair> found;
  for (const auto& p : pairs(nb::cast<nb::list>(x[1]), n.joints)) found.emplace_back(p.first, p.second, s.mechanics.supports());
  std::vector<Law> laws;
  std::vector<int> of;
  for (nb::handle h : nb::cast<nb::list>(x[2])) {
    int pair;
    laws.push_back(law(nb::cast<nb::dict>(h), n, states, static_cast<int>(found.size()), pair, callbacks));
    of.push_back(pair);
  }
  PerturbedLaws out(std::move(found), std::move(laws), of);
  out.weight = nb::cast<double>(x[0]);
  return out;
}

PerturbedRows near_rows(const nb::tuple& x, const Sizes& n, size_t count, const Index2System& s, Callbacks& callbacks) {
  if (x.size() != 4) refuse("rows nearby are a weight, pairs, rows and drivers");
  auto found = pairs(nb::cast<nb::list>(x[1]), n.joints);
  std::vector<Row> rows;
  for (nb::handle h : nb::cast<nb::list>(x[2])) rows.push_back(row(nb::cast<nb::dict>(h), n, static_cast<int>(found.size()), callbacks));
  if (rows.size() != count) refuse("as many rows nearby as there are");
  std::vector<Driver> drivers;
  for (nb::handle h : nb::cast<nb::list>(x[3])) drivers.push_back(driver(nb::cast<nb::dict>(h), rows.size(), callbacks));
  return {nb::cast<double>(x[0]),
          std::make_unique<Constraints>(s.mechanics, std::move(rows), found, std::move(drivers))};
}

PyParameters bind_parameters(PyCore& c, int count, const nb::list& stuff_list, const nb::list& direction_list,
                  const nb::list& changed_list) {
  const CoreLock lock(c);
  Index2System& s = c.core->system;
  if (s.formulation == Formulation::index1) refuse("tangents are those of index 2 and GGL");
  if (count < 0) refuse("how many parameters there are is not negative");
  const Sizes n{s.nq, s.nv, s.mechanics.joints};
  auto made_of = stuff(stuff_list, s);
  auto along = directions(direction_list, made_of, count, s.nv);
  std::vector<ChangedElement> changed;
  for (nb::handle h : changed_list) {
    const auto x = nb::cast<nb::tuple>(h);
    if (x.size() != 4) refuse("a change is a parameter, numbers of states or rows, laws and rows");
    changed.emplace_back();
    ChangedElement& one = changed.back();
    one.parameter = nb::cast<int>(x[0]), one.at = nb::cast<std::vector<int>>(x[1]);
    within({one.parameter}, count, "parameter");
    const auto laws = nb::cast<nb::list>(x[2]), rows = nb::cast<nb::list>(x[3]);
    within(one.at, laws.size() ? s.ns : s.ng, laws.size() ? "state" : "row");
    const int states = static_cast<int>(one.at.size());
    for (nb::handle l : laws) one.laws.push_back(near_laws(nb::cast<nb::tuple>(l), n, states, s, *c.callbacks));
    for (nb::handle r : rows) one.rows.push_back(near_rows(nb::cast<nb::tuple>(r), n, one.at.size(), s, *c.callbacks));
  }
  return {&c, std::make_unique<Parameters>(s, count, std::move(made_of), std::move(along), std::move(changed))};
}

// Steps and their data, checked; arrays live as long as the call.
struct Nodes {
  Nodes(PyCore& c, nb::handle method, bool halved, bool project, const Array& t, const Array& y, const PyParameters* p = nullptr)
      : ny(c.core->system.ny), nodes(t.size()), ts(t.data(), t.data() + nodes),
        ys(numbers(y, nodes * c.core->system.length, "y")),
        segment{nb::isinstance<Tableau>(method) ? nb::cast<const Tableau*>(method) : nullptr,
                nb::isinstance<Radau>(method) ? nb::cast<const Radau*>(method) : nullptr,
                halved, project, nodes - 1, ts.data(), ys.data()},
        nc(carry_size(c.core->system, segment)) {
    if (!nodes) refuse("a segment has a node");
    if (!segment.tableau && !segment.radau) refuse("a method is a tableau or Radau");
    if (c.core->system.formulation == Formulation::index1) refuse("tangents are those of index 2 and GGL");
    if (p && p->core != &c) refuse("the parameters are those of another core");
    if ((p || project || segment.radau) && !c.core->system.mechanics.expanded()) refuse("partials need the expanded tree");
  }
  const size_t ny, nodes;
  const Numbers ts, ys;
  const TrajectorySegment segment;
  const size_t nc;
};

template <class F>
bool done(PyCore& c, F&& compute) {
  bool failed = false;
  c.core->system.point.forget();
  run_unlocked(c, [&] {
    try {
      compute(c.core->system);
    } catch (const FallBackToPython&) {
      failed = true;
    }
  });
  return !failed;
}

nb::object recompute_steps(PyCore& c, nb::handle a, bool halved, const Run& run, const Array& t, const Array& y,
                      const Array& carry, double same_state, double agreement) {
  const CoreLock lock(c);
  const Nodes x(c, a, halved, run.project, t, y);
  if (x.segment.radau) refuse("a collocation method carries nothing");
  const RepeatTolerances like{run.adaptive, run.control, run.tolerated_move, run.tiny, same_state, agreement};
  const size_t sizes = like.control.atol.size();
  if (like.adaptive && sizes != 1 && sizes != static_cast<size_t>(c.core->system.measured()))
    refuse("atol has the wrong length");
  Recomputed out;
  out.carries = numbers(carry, x.nc, "carry"), out.carries.resize(x.nodes * x.nc);
  if (!done(c, [&](Index2System& s) { recompute(s, x.segment, like, out); })) return nb::none();
  return nb::make_tuple(array(out.carries, {x.nodes, x.nc}), out.restarted, out.steps, vector(out.end));
}

// While it exists, the core asks a Python function for the partials of friction.
class WithFriction {
 public:
  WithFriction(PyCore& c, Parameters& p, const nb::object& f) : p_(p) {
    if (f.is_none()) return;
    p.friction = [f = f.ptr(), interrupted = &c.callbacks->interrupted](
                     const Numbers& q, const Numbers& v, const Numbers& lam, Numbers& K, Numbers& D, Numbers& P) {
      call_python(f, interrupted, {{q.data(), q.size()}, {v.data(), v.size()}, {lam.data(), lam.size()}}, {&K, &D, &P});
    };
  }
  ~WithFriction() { p_.friction = nullptr; }
  WithFriction(const WithFriction&) = delete;

 private:
  Parameters& p_;
};

nb::object adjoint_of_steps(PyCore& c, PyParameters& p, nb::handle a, bool halved, bool project, const Array& t, const Array& y,
                   const Array& carries, const Array& extra, const Array& bar, const nb::object& friction) {
  const CoreLock lock(c);
  const WithFriction with_friction(c, *p.partials, friction);
  const Nodes x(c, a, halved, project, t, y, &p);
  const size_t width = x.ny + x.nc;
  const Numbers known = numbers(carries, x.nodes * x.nc, "carries"), more = numbers(extra, x.nodes * width, "extra");
  Numbers by_start = numbers(bar, width, "bar"), by_p(p.partials->count());
  if (!done(c, [&](Index2System& s) {
        adjoint(s, *p.partials, x.segment, known.data(), more.data(), by_start.data(), by_p.data());
      }))
    return nb::none();
  return nb::make_tuple(vector(by_start), vector(by_p));
}

nb::object tangent_of_steps(PyCore& c, PyParameters& p, nb::handle a, bool halved, bool project, const Array& t, const Array& y,
                    const Array& carries, const Array& first, const Array& dp,
                    const std::optional<Array>& dh, const nb::object& friction) {
  const CoreLock lock(c);
  const WithFriction with_friction(c, *p.partials, friction);
  const Nodes x(c, a, halved, project, t, y, &p);
  const size_t width = x.ny + x.nc, d = first.size() / width;
  const Numbers known = numbers(carries, x.nodes * x.nc, "carries"), along_p = numbers(dp, d * p.partials->count(), "dp");
  const Numbers start = numbers(first, d * width, "first");
  const Numbers late = dh ? numbers(*dh, d, "dh") : Numbers();
  Numbers along(x.nodes * d * width);
  if (!done(c, [&](Index2System& s) {
        tangent(s, *p.partials, x.segment, known.data(), static_cast<int>(d), along_p.data(),
                dh ? late.data() : nullptr, start.data(), along.data());
      }))
    return nb::none();
  return nb::cast(array(along, {x.nodes, d, width}));
}

// The nearest point on the closures, or with v alone the nearest that they allow; and its partials (ny, ny + k).
nb::object projection(PyCore& c, PyParameters& p, double t, const Array& y, bool positions) {
  const CoreLock lock(c);
  Index2System& s = c.core->system;
  if (p.core != &c) refuse("the parameters are those of another core");
  if (!s.mechanics.expanded()) refuse("partials need the expanded tree");
  const size_t ny = s.ny, k = p.partials->count(), d = ny + k;
  Numbers at = numbers(y, s.length, "y"), moved(d * ny, 0.0), dp(d * k, 0.0);
  for (size_t i = 0; i < ny; ++i) moved[i * ny + i] = 1;
  for (size_t i = 0; i < k; ++i) dp[(ny + i) * k + i] = 1;
  if (!done(c, [&](Index2System&) {
        ProjectionSensitivity end(s, *p.partials, true);
        end.take(t, at.data(), positions), end.forward(static_cast<int>(d), moved.data(), ny, dp.data(), nullptr);
      }))
    return nb::none();
  return nb::make_tuple(vector(at), array(moved, {d, ny}));
}

}  // namespace

void bind_tangents(nb::module_& m, nb::class_<PyCore>& core) {
  nb::class_<PyParameters>(m, "Parameters", "Numbers of a mechanism that bind_parameters.");
  core.def("bind_parameters", bind_parameters, nb::keep_alive<0, 1>(), nb::arg("count"), nb::arg("stuff"), nb::arg("directions"),
           nb::arg("changed"), "Say how parameters change what the mechanism is made of, its laws and its rows.")
      .def("recompute", recompute_steps, nb::arg("method"), nb::arg("halved"), nb::arg("run"), nb::arg("t"), nb::arg("y"),
           nb::arg("carry"), nb::arg("same_state"), nb::arg("agreement"),
           "Return what is carried to each node (m + 1, nc), whether it was found anew there, how many steps could be "
           "repeated, and where they end; or None.")
      .def("adjoint", adjoint_of_steps, nb::arg("parameters"), nb::arg("method"), nb::arg("halved"), nb::arg("project"), nb::arg("t"), nb::arg("y"),
           nb::arg("carries"), nb::arg("extra"), nb::arg("bar"), nb::arg("friction") = nb::none(),
           "Return the cotangents of y and carry (ny + nc,), and of parameters (k,), of those behind steps, or None.")
      .def("tangent", tangent_of_steps, nb::arg("parameters"), nb::arg("method"), nb::arg("halved"), nb::arg("project"), nb::arg("t"),
           nb::arg("y"), nb::arg("carries"), nb::arg("first"), nb::arg("dp"), nb::arg("dh") = nb::none(), nb::arg("friction") = nb::none(),
           "Return variations of y and carry at all nodes, (m + 1, d, ny + nc), or None; dh (d,) are those of the step sizes. friction: (q, v, lam) -> K (n, nv), D (n, n), P (k, n) of friction that depends on multipliers.")
      .def("projection", projection, nb::arg("parameters"), nb::arg("t"), nb::arg("y"), nb::arg("positions"),
           "Return the nearest point that satisfies the closures, or the nearest v alone, and its partials by y and the "
           "parameters, transposed, (ny + k, ny); or None.");
}

}  // namespace mbdae
