// The functions of FMI 3.0 (https://fmi-standard.org/docs/3.0.1) for exported mechanisms.
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>

#include "runtime/fmu_instance.hpp"

using namespace mbdae;
using namespace mbdae::fmi;

namespace {

void* instantiate(const char* token, const char* folder, bool exchange, void* environment, Logger log) {
  try {
    std::ifstream file(std::string(folder ? folder : "") + "/mechanism.json", std::ios::binary);
    std::stringstream text;
    text << file.rdbuf();
    if (!file) throw std::invalid_argument("resources/mechanism.json cannot be read");
    auto* out = new Instance{ExportedMechanism(text.str()), log, environment, exchange};
    if (token && out->mechanism.token() == token) return out;
    delete out;
    throw std::invalid_argument("the instantiation token is not that of resources/mechanism.json");
  } catch (const std::exception& e) {
    if (log) log(environment, error, "logStatusError", e.what());
    return nullptr;
  }
}

// Call add(i, j, entry) for the partial of each unknown i with respect to each known j.
template <class Add>
void for_derivatives(ExportedMechanism& m, References unknowns, size_t rows, References knowns, size_t columns, Add&& add) {
  const ExportedMechanism::Derivatives& d = m.derivatives();
  const size_t states = m.states(), width = states + m.inputs.size();
  for (size_t i = 0; i < rows; ++i) {
    const Variable unknown = variable(m, unknowns[i]);
    if (unknown.kind != Variable::output && unknown.kind != Variable::rate)
      throw std::invalid_argument("unknowns of derivatives must be outputs or derivatives of states");
    const Vector& entries = unknown.kind == Variable::output ? d.outputs : d.rates;
    for (size_t j = 0; j < columns; ++j) {
      const Variable known = variable(m, knowns[j]);
      if (known.kind != Variable::state && known.kind != Variable::input)
        throw std::invalid_argument("knowns of derivatives must be states or inputs");
      add(i, j, entries[unknown.i * width + known.i + (known.kind == Variable::input ? states : 0)]);
    }
  }
}

}  // namespace

FMI3 const char* fmi3GetVersion() { return "3.0"; }
FMI3 Status fmi3SetDebugLogging(void*, bool, size_t, const char* const*) { return ok; }

FMI3 void* fmi3InstantiateModelExchange(const char*, const char* token, const char* folder, bool, bool, void* environment,
                                        Logger log) {
  return instantiate(token, folder, true, environment, log);
}

FMI3 void* fmi3InstantiateCoSimulation(const char*, const char* token, const char* folder, bool, bool, bool events,
                                       bool early_return, References, size_t, void* environment, Logger log,
                                       IntermediateUpdate update) {
  auto* out = static_cast<Instance*>(instantiate(token, folder, false, environment, log));
  if (out) out->update = update, out->early_return = early_return, out->events = events && early_return;
  return out;
}

FMI3 void* fmi3InstantiateScheduledExecution(const char*, const char*, const char*, bool, bool, void* environment, Logger log,
                                             void (*)(void*), void (*)(), void (*)()) {
  if (log) log(environment, error, "logStatusError", "scheduled execution is not supported");
  return nullptr;
}

FMI3 void fmi3FreeInstance(void* x) { delete static_cast<Instance*>(x); }

FMI3 Status fmi3EnterInitializationMode(void* instance, bool, double, double t, bool, double) {
  return attempt(instance, [&](Instance& x) { x.start = t, x.initializing = true; });
}
FMI3 Status fmi3ExitInitializationMode(void* instance) {
  return attempt(instance, [&](Instance& x) { begin(x), x.initializing = false; });
}
FMI3 Status fmi3EnterEventMode(void*) { return ok; }
FMI3 Status fmi3Terminate(void*) { return ok; }
FMI3 Status fmi3Reset(void* instance) {
  return attempt(instance, [&](Instance& x) { x.mechanism.reset(), x.initializing = false; });
}

FMI3 Status fmi3GetFloat64(void* instance, References references, size_t n, double* values, size_t size) {
  return attempt(instance, [&](Instance& x) {
    if (n != size) throw std::invalid_argument("values must be as many as variables");
    for (size_t i = 0; i < n; ++i) {
      if (variable(x.mechanism, references[i]).kind >= Variable::output) begin(x);
      values[i] = value(x.mechanism, references[i]);
    }
  });
}

FMI3 Status fmi3SetFloat64(void* instance, References references, size_t n, const double* values, size_t size) {
  return attempt(instance, [&](Instance& x) {
    if (n != size) throw std::invalid_argument("values must be as many as variables");
    for (size_t i = 0; i < n; ++i) {
      const Variable target = variable(x.mechanism, references[i]);
      if (target.kind == Variable::input) {
        x.mechanism.set_input(target.i, values[i]);
      } else if (target.kind == Variable::parameter) {
        if (x.mechanism.started() && !x.initializing)
          throw std::invalid_argument("parameters must be set before the end of the initialization");
        x.mechanism.set_parameter(target.i, values[i]);
      } else if (target.kind == Variable::state && x.mechanism.started()) {
        Vector state = x.mechanism.x();
        state[target.i] = values[i], x.mechanism.set_x(state.data());
      } else {
        throw std::invalid_argument("only inputs, parameters, and after the initialization states can be set");
      }
    }
  });
}

FMI3 Status fmi3DoStep(void* instance, double t, double step, bool, bool* event, bool* terminate, bool* early, double* last) {
  auto& x = *static_cast<Instance*>(instance);
  *event = *terminate = *early = false;
  const Status out = attempt(instance, [&](Instance&) {
    const auto after_step = [&](double time, bool finished) {
      bool requested = false;
      double return_time = time;
      x.update(x.environment, time, false, true, finished, x.early_return, &requested, &return_time);
      return requested && x.early_return;
    };
    if (std::fabs(x.mechanism.time() - t) > step)
      throw std::invalid_argument("a step must begin where the one before ended");
    x.mechanism.advance(t + step, x.update ? ExportedMechanism::AfterStep(after_step) : nullptr, x.events);
    *event = x.mechanism.before_impact();
  });
  *last = x.mechanism.time();
  *early = out == ok && *last < t + step && std::fabs(*last - (t + step)) > x.mechanism.coincident();
  return out;
}

FMI3 Status fmi3EnterStepMode(void*) { return ok; }
FMI3 Status fmi3EnterContinuousTimeMode(void*) { return ok; }
FMI3 Status fmi3EnterConfigurationMode(void*) { return ok; }
FMI3 Status fmi3ExitConfigurationMode(void*) { return ok; }
FMI3 Status fmi3EvaluateDiscreteStates(void*) { return ok; }

FMI3 Status fmi3UpdateDiscreteStates(void* instance, bool* needs_update, bool* terminate, bool* nominals, bool* values,
                                     bool* next, double* time) {
  *needs_update = *terminate = *nominals = *values = *next = false, *time = 0;
  return attempt(instance, [&](Instance& x) {
    x.mechanism.pass_impact();
    if (!x.exchange || x.initializing) return;
    if (x.mechanism.update_mode()) {
      *values = *nominals = true;
    } else if (x.mechanism.margin() < x.mechanism.restart_margin()) {
      x.mechanism.restart(), *values = *nominals = true;
    }
    if (const double event = x.mechanism.next_event(); std::isfinite(event)) *next = true, *time = event;
  });
}

FMI3 Status fmi3CompletedIntegratorStep(void* instance, bool, bool* event, bool* terminate) {
  *event = *terminate = false;
  return attempt(instance, [&](Instance& x) { *event = x.mechanism.complete_step(); });
}

FMI3 Status fmi3SetTime(void* instance, double t) {
  return attempt(instance, [&](Instance& x) { x.mechanism.set_time(t); });
}
FMI3 Status fmi3SetContinuousStates(void* instance, const double* values, size_t n) {
  return attempt(instance, [&](Instance& x) {
    if (n != static_cast<size_t>(x.mechanism.states())) throw std::invalid_argument("values must be as many as states");
    x.mechanism.set_x(values);
  });
}
FMI3 Status fmi3GetContinuousStates(void* instance, double* values, size_t n) {
  return attempt(instance, [&](Instance& x) {
    begin(x);
    std::copy_n(x.mechanism.x().begin(), n, values);
  });
}
FMI3 Status fmi3GetContinuousStateDerivatives(void* instance, double* values, size_t n) {
  return attempt(instance, [&](Instance& x) { std::copy_n(x.mechanism.rate().begin(), n, values); });
}
FMI3 Status fmi3GetNominalsOfContinuousStates(void* instance, double* values, size_t n) {
  return attempt(instance, [&](Instance&) { std::fill_n(values, n, 1.0); });
}
FMI3 Status fmi3GetEventIndicators(void* instance, double* values, size_t n) {
  return attempt(instance, [&](Instance& x) {
    if (n != x.mechanism.indicators()) throw std::invalid_argument("values must be as many as event indicators");
    const Vector indicators = x.mechanism.indicator_values();
    std::copy(indicators.begin(), indicators.end(), values);
  });
}
FMI3 Status fmi3GetNumberOfEventIndicators(void* instance, size_t* n) {
  return attempt(instance, [&](Instance& x) { *n = x.mechanism.indicators(); });
}
FMI3 Status fmi3GetNumberOfContinuousStates(void* instance, size_t* n) {
  return attempt(instance, [&](Instance& x) { *n = x.mechanism.states(); });
}

FMI3 Status fmi3GetDirectionalDerivative(void* instance, References unknowns, size_t rows, References knowns, size_t columns,
                                         const double* seed, size_t, double* out, size_t) {
  return attempt(instance, [&](Instance& x) {
    begin(x), std::fill_n(out, rows, 0.0);
    for_derivatives(x.mechanism, unknowns, rows, knowns, columns,
                    [&](size_t i, size_t j, double entry) { out[i] += entry * seed[j]; });
  });
}
FMI3 Status fmi3GetAdjointDerivative(void* instance, References unknowns, size_t rows, References knowns, size_t columns,
                                     const double* seed, size_t, double* out, size_t) {
  return attempt(instance, [&](Instance& x) {
    begin(x), std::fill_n(out, columns, 0.0);
    for_derivatives(x.mechanism, unknowns, rows, knowns, columns,
                    [&](size_t i, size_t j, double entry) { out[j] += entry * seed[i]; });
  });
}

FMI3 Status fmi3GetFMUState(void* instance, void** state) {
  return attempt(instance, [&](Instance& x) {
    begin(x);
    Vector saved = x.mechanism.state();
    if (!*state) *state = new Vector();
    *static_cast<Vector*>(*state) = std::move(saved);
  });
}
FMI3 Status fmi3SetFMUState(void* instance, void* state) {
  return attempt(instance, [&](Instance& x) { x.mechanism.set_state(*static_cast<Vector*>(state)); });
}
FMI3 Status fmi3FreeFMUState(void*, void** state) {
  if (state) delete static_cast<Vector*>(*state), *state = nullptr;
  return ok;
}
FMI3 Status fmi3SerializedFMUStateSize(void*, void* state, size_t* size) {
  return *size = sizeof(double) * static_cast<Vector*>(state)->size(), ok;
}
FMI3 Status fmi3SerializeFMUState(void* instance, void* state, std::uint8_t* bytes, size_t size) {
  return attempt(instance, [&](Instance&) {
    const auto& numbers = *static_cast<Vector*>(state);
    if (size < sizeof(double) * numbers.size()) throw std::invalid_argument("too few bytes for the state");
    std::memcpy(bytes, numbers.data(), sizeof(double) * numbers.size());
  });
}
FMI3 Status fmi3DeserializeFMUState(void* instance, const std::uint8_t* bytes, size_t size, void** state) {
  return attempt(instance, [&](Instance&) {
    if (size % sizeof(double)) throw std::invalid_argument("the state does not belong to this mechanism");
    auto* numbers = new Vector(size / sizeof(double));
    std::memcpy(numbers->data(), bytes, size), *state = numbers;
  });
}
