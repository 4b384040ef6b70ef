#include "bindings/description.hpp"

#include <algorithm>

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
Law::Call law_function(nb::handle f, const Sizes& n, int k, bool* interrupted) {
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
  return [=](double t, const double* q, const double* v, const double* s, Vector& out) {
    guarded(interrupted, [&] {
      const auto known = nb::cast<Array>(f(t, argument(q, n.nq), argument(v, n.nv), argument(s, k)));
      if (known.size() < out.size()) throw FallBackToPython();
      std::copy(known.data(), known.data() + out.size(), out.begin());
    });
  };
}

}  // namespace

void call_python(nb::handle f, bool* interrupted, const std::vector<std::pair<const double*, size_t>>& in,
                 const std::vector<Vector*>& out) {
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

void PyDescriptionReader::bind_functions(nb::handle h, TimeFunction& out) {
  out.call = [f = function(h, "call"), interrupted = &callbacks_.interrupted](double t, int k) {
    double x = NAN;
    guarded(interrupted, [&] { x = nb::cast<double>(f(t, k)); });
    return x;
  };
}

void PyDescriptionReader::bind_functions(nb::handle h, RowFunction& out) {
  const auto select = [](const double* x, const std::vector<int>& indices) {
    Vector selected;
    for (int i : indices) selected.push_back(x[i]);
    return selected;
  };
  const auto of_q = [&](const char* key) {
    return [=, f = function(h, key), iq = out.iq, interrupted = &callbacks_.interrupted](const double* q,
                                                                                                Vector& to) {
      const Vector x = select(q, iq);
      call_python(f, interrupted, {{x.data(), x.size()}}, {&to});
    };
  };
  out.value = of_q("value"), out.partials = of_q("partials");
  out.bias = [=, f = function(h, "bias"), iq = out.iq, iv = out.iv, interrupted = &callbacks_.interrupted](
                  const double* q, const double* v) {
    const Vector x = select(q, iq), rates = select(v, iv);
    Vector to(1);
    call_python(f, interrupted, {{x.data(), x.size()}, {rates.data(), rates.size()}}, {&to});
    return to[0];
  };
}

void PyDescriptionReader::bind_functions(nb::handle h, Law& out) {
  bool* const interrupted = &callbacks_.interrupted;
  out.call = law_function(function(h, "call"), n_, out.states, interrupted);
  out.partials = partials(function(h, "partials"), n_, out.states, interrupted);
  out.time_rate = partials(function(h, "time_rate"), n_, out.states, interrupted);
}

void PyDescriptionReader::bind_functions(nb::handle h, SampledController& out) {
  out.call = [f = function(h, "call"), n = n_, all = states_, k = out.states, interrupted = &callbacks_.interrupted](
                 double t, const double* q, const double* v, const double* s, double* after) {
    guarded(interrupted, [&] {
      const auto found = nb::cast<Array>(f(t, argument(q, n.nq), argument(v, n.nv), argument(s, all)));
      if (found.size() != static_cast<size_t>(k)) throw FallBackToPython();
      std::copy(found.data(), found.data() + k, after);
    });
  };
}

}  // namespace mbdae
