// An instance of an FMU, and its variables. Value references: 0 for time, then inputs, parameters, outputs, states,
// their derivatives, and event indicators.
#pragma once

#include <cstdint>
#include <string>

#include "runtime/exported_mechanism.hpp"

#define FMI3 extern "C" __attribute__((visibility("default")))

namespace mbdae::fmi {

enum Status { ok, warning, discard, error, fatal };
using Logger = void (*)(void* environment, Status status, const char* category, const char* message);
using IntermediateUpdate = void (*)(void* environment, double t, bool can_set, bool can_get, bool finished, bool can_return,
                                    bool* requested, double* return_time);
using References = const std::uint32_t*;

struct Instance {
  ExportedMechanism mechanism;
  Logger log;
  void* environment;
  bool exchange;  // model exchange; otherwise co-simulation
  IntermediateUpdate update = nullptr;
  bool early_return = false, initializing = false, events = false;
  double start = 0;

  Status report(Status status, const char* text) const {
    if (log) log(environment, status, status == discard ? "logStatusDiscard" : "logStatusError", text);
    return status;
  }
};

// Execute a call and report its failure; outside the range of the coordinates the status is `discard`, so that the
// solver takes a shorter step.
template <class F>
Status attempt(void* instance, F&& call) {
  auto& x = *static_cast<Instance*>(instance);
  try {
    call(x);
    return ok;
  } catch (const FallBackToPython&) {
    return x.report(discard, "the point is singular, or beyond the range of the local coordinates: take a shorter step");
  } catch (const std::exception& e) {
    return x.report(error, e.what());
  }
}

struct Variable {
  enum Kind { time, input, parameter, output, state, rate, indicator } kind;
  int i;
};

inline Variable variable(const ExportedMechanism& m, std::uint32_t reference) {
  if (!reference) return {Variable::time, 0};
  size_t i = reference - 1;
  const size_t states = m.states(), sizes[] = {m.inputs.size(), m.parameters.size(), m.outputs.size(), states, states,
                                         m.indicators()};
  for (int kind = 0; kind < 6; i -= sizes[kind++])
    if (i < sizes[kind]) return {static_cast<Variable::Kind>(Variable::input + kind), static_cast<int>(i)};
  throw std::invalid_argument("unknown value reference " + std::to_string(reference));
}

inline double value(ExportedMechanism& m, std::uint32_t reference) {
  const Variable x = variable(m, reference);
  switch (x.kind) {
    case Variable::time:
      return m.time();
    case Variable::input:
      return m.input(x.i);
    case Variable::parameter:
      return m.parameter(x.i);
    case Variable::output:
      return m.output(x.i);
    case Variable::state:
      return m.x()[x.i];
    case Variable::rate:
      return m.rate()[x.i];
    default:
      return m.indicator_values()[x.i];
  }
}

inline void begin(Instance& x) {
  if (!x.mechanism.started()) x.mechanism.start(x.start, !x.exchange);
}

}  // namespace mbdae::fmi
