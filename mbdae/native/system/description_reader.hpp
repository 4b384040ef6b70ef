// Reader of the description of a mechanism from Python dicts or JSON. core_description_checks.hpp checks indices of
// pairs and rows.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "math/field_reader.hpp"
#include "system/core_description_checks.hpp"

namespace mbdae {

template <class Data>
class DescriptionReader : public Reader<DescriptionReader<Data>, Data> {
 public:
  using Base = Reader<DescriptionReader<Data>, Data>;
  using typename Base::Access;

  DescriptionReader(const Sizes& n, int states) : n_(n), states_(states) {}
  virtual ~DescriptionReader() = default;

  using Base::read;
  void read(Data h, TimeFunction& out);
  void read(Data h, Row& out);
  void read(Data h, Law& out);
  void read(Data h, SampledController& out);
  void read(Data h, std::shared_ptr<const Profile>& out);

 protected:
  // Bind user functions in a description; readers of data without functions reject them.
  virtual void bind_functions(Data, TimeFunction&) { reject_functions(); }
  virtual void bind_functions(Data, RowFunction&) { reject_functions(); }
  virtual void bind_functions(Data, Law&) { reject_functions(); }
  virtual void bind_functions(Data, SampledController&) { reject_functions(); }

  const Sizes n_;
  const int states_;  // number of states of all laws

 private:
  [[noreturn]] static void reject_functions() { reject("Python functions are not supported"); }
  void check_states(int first, int count) const {
    if (first < 0 || count < 0 || count > states_ || first > states_ - count) reject("states out of range");
  }
};

template <class Data>
void DescriptionReader<Data>::read(Data h, TimeFunction& out) {
  this->read_fields(h, out, false);
  bool valid = out.kind == TimeFunction::python || out.a.size() == 4;
  if (out.kind == TimeFunction::polynomials)
    valid = out.degree >= 0 && (out.input < 0 || (out.degree == 1 && out.b.size() == 1)) && !out.b.empty() &&
            out.a.size() == out.b.size() * (static_cast<size_t>(out.degree) + 1);
  if (!valid) reject("the parameters of a function of time do not match its kind");
  if (out.kind == TimeFunction::python) bind_functions(h, out);
}

template <class Data>
void DescriptionReader<Data>::read(Data h, std::shared_ptr<const Profile>& out) {
  auto p = std::make_shared<Profile>();
  this->read_fields(h, *p, true);
  const size_t n = p->coefficients.size(), polynomials = p->starts.size() - 1;
  if (p->starts.size() < 2 || p->samples.empty() || p->degree < 0 || n < 2 || n % 2 ||
      !(p->starts.back() > p->starts[0]) || !std::is_sorted(p->starts.begin(), p->starts.end()) ||
      (!p->harmonic && n != 2 * polynomials * (static_cast<size_t>(p->degree) + 1)))
    reject("the coefficients of a profile do not match its degree and its polynomials");
  for (double s : p->samples) {
    const Profile::Point x = p->at(s);
    p->points.insert(p->points.end(), x.c, x.c + 2);
  }
  out = p;
}

template <class Data>
void DescriptionReader<Data>::read(Data h, Row& out) {
  const Row::Kind kind = this->template read<Row::Kind>(this->field_of(h, "kind"));
  out.positional = ROW_KINDS.at(kind).positional;
  this->read_fields(h, out, false);
  for (const std::string& key : split_names(ROW_KINDS.at(out.kind).required)) {
    this->field_of(h, key.c_str());
    out.has_a = out.has_a || key == "a", out.has_b = out.has_b || key == "b";
  }
  if (out.kind == Row::function) {
    auto f = std::make_shared<RowFunction>();
    this->read_fields(h, *f, true);
    check_indices(f->iq, n_.nq, "coordinate"), check_indices(f->iv, n_.nv, "velocity");
    bind_functions(h, *f), out.python = f;
  }
  if (out.between_joints()) check_row_joints(out, n_);
}

template <class Data>
void DescriptionReader<Data>::read(Data h, Law& out) {
  const auto name = Access::template cast<std::string>(this->field_of(h, "kind"));
  if (!(out.kind = law_kind(name))) throw UnknownKind(name);
  this->read_fields(h, out, false);
  check_states(out.state, out.states);
  if (Access::contains(h, "call")) bind_functions(h, out);
  if (!out.kind->is_valid(out, n_)) reject("the data of a force law do not match its kind");
}

template <class Data>
void DescriptionReader<Data>::read(Data h, SampledController& out) {
  const auto kind = this->template read<SampledController::Kind>(this->field_of(h, "kind"));
  this->read_fields(h, out, kind == SampledController::pid);
  if (!(out.rate > 0) || !std::isfinite(out.offset) || !(out.coincide >= 0))
    reject("a sampled controller must have a positive rate, a finite offset and a time tolerance of at least 0");
  if (out.states < 1) reject("a sampled controller must have a state");
  check_states(out.state, out.states);
  for (const HeldInput& u : out.inputs)
    check_indices({u.value, std::max(u.rate, 0), std::max(u.instant, 0)}, states_, "state");
  if (out.kind != SampledController::pid) return bind_functions(h, out);
  check_indices({out.x, out.v}, n_.nq + n_.nv, "coordinate");
  if (out.a.size() != 3 || out.states > 2) reject("a PID controller must have three gains, and at most two states");
}

}  // namespace mbdae
