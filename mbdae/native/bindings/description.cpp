// Python functions in the description of a mechanism: force laws, rows, functions of time, controllers.
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

// Call a Python function; an exception makes the run fall back to Python, which calls it again and reports the error.
template <class F>
void catch_python_errors(bool* interrupted, F&& f) {
  nb::gil_scoped_acquire gil;
  try {
    f();
  } catch (nb::python_error& e) {
    if (!e.matches(PyExc_Exception)) {  // Ctrl-C, exit: re-raised at the end of the call
      *interrupted = true, e.restore();
      throw Interrupted();
    }
    throw FallBackToPython();
  } catch (const nb::cast_error&) {
    throw FallBackToPython();
  }
}

// A function (t, q, v, s) -> (tau, s'), s (k,); it adds to tau.
Law::Call law_function(nb::handle f, const Sizes& n, int k, bool* interrupted) {
  return [=](double t, const double* q, const double* v, const double* s, double* tau, double* ds) {
    catch_python_errors(interrupted, [&] {
      const nb::tuple result(f(t, argument(q, n.nq), argument(v, n.nv), argument(s, k)));
      if (result.size() != 2) throw FallBackToPython();
      const auto force = nb::cast<Array>(result[0]);
      if (force.size() != static_cast<size_t>(n.nv)) throw FallBackToPython();
      for (int i = 0; i < n.nv; ++i) tau[i] += force.data()[i];
      if (!k) return;
      const auto rate = nb::cast<Array>(result[1]);
      if (rate.size() != static_cast<size_t>(k)) throw FallBackToPython();
      std::copy(rate.data(), rate.data() + k, ds);
    });
  };
}

// A function (t, q, v, s) -> partials of (tau, s'), (nv + k, 2 nv + k), or their time derivatives (nv + k,).
Law::Partials partials(nb::handle f, const Sizes& n, int k, bool* interrupted) {
  return [=](double t, const double* q, const double* v, const double* s, Vector& out) {
    catch_python_errors(interrupted, [&] {
      const auto values = nb::cast<Array>(f(t, argument(q, n.nq), argument(v, n.nv), argument(s, k)));
      if (values.size() < out.size()) throw FallBackToPython();
      std::copy(values.data(), values.data() + out.size(), out.begin());
    });
  };
}

}  // namespace

void call_python(nb::handle f, bool* interrupted, const std::vector<std::pair<const double*, size_t>>& in,
                 const std::vector<Vector*>& out) {
  catch_python_errors(interrupted, [&] {
    nb::list arguments;
    for (const auto& [x, n] : in) arguments.append(argument(x, n));
    const nb::object result = f(*nb::tuple(arguments));
    for (size_t i = 0; i < out.size(); ++i) {
      const auto values = nb::cast<Array>(out.size() > 1 ? nb::object(result[i]) : result);
      if (values.size() != out[i]->size()) throw FallBackToPython();
      std::copy(values.data(), values.data() + values.size(), out[i]->begin());
    }
  });
}

void PyDescriptionReader::bind_functions(nb::handle h, TimeFunction& out) {
  out.call = [f = function(h, "call"), interrupted = &callbacks_.interrupted](double t, int k) {
    double x = NAN;
    catch_python_errors(interrupted, [&] { x = nb::cast<double>(f(t, k)); });
    return x;
  };
}

void PyDescriptionReader::bind_functions(nb::handle h, RowFunction& out) {
  const auto select = [](const double* x, const std::vector<int>& indices) {
    Vector selected;
    for (int i : indices) selected.push_back(x[i]);
    return selected;
  };
  const auto function_of_q = [&](const char* key) {
    return
        [=, f = function(h, key), iq = out.iq, interrupted = &callbacks_.interrupted](const double* q, Vector& result) {
          const Vector x = select(q, iq);
          call_python(f, interrupted, {{x.data(), x.size()}}, {&result});
        };
  };
  out.value = function_of_q("value"), out.partials = function_of_q("partials");
  out.bias = [=, f = function(h, "bias"), iq = out.iq, iv = out.iv, interrupted = &callbacks_.interrupted](
                  const double* q, const double* v) {
    const Vector x = select(q, iq), rates = select(v, iv);
    Vector result(1);
    call_python(f, interrupted, {{x.data(), x.size()}, {rates.data(), rates.size()}}, {&result});
    return result[0];
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
    catch_python_errors(interrupted, [&] {
      const auto result = nb::cast<Array>(f(t, argument(q, n.nq), argument(v, n.nv), argument(s, all)));
      if (result.size() != static_cast<size_t>(k)) throw FallBackToPython();
      std::copy(result.data(), result.data() + k, after);
    });
  };
}

}  // namespace mbdae
