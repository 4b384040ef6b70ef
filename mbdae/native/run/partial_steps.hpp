// Partial steps from the start of the last step, on which events are located.
#pragma once

#include "run/time_loop.hpp"

namespace mbdae {

class TimeLoop::PartialSteps {
 public:
  PartialSteps(TimeLoop& loop, double h) : loop_(loop), h_(h), restarted_(loop.restarted_) {}

  Vector take(double theta) {
    Run& run = loop_.run_;
    const double t = run.interval.t;
    if (!has_saved_end()) {
      end_ = std::move(loop_.next_), loop_.next_ = State();
      z_ = loop_.z_, size_ = loop_.size1_;
    }
    loop_.method_.take(run.adaptive, t, theta * h_, run.state, loop_.next_, loop_.z_.data(), loop_.errors_);
    if (run.adaptive || run.project) loop_.s_.component_magnitudes(loop_.next_.y.data(), loop_.size1_.data());
    if (run.project) loop_.project(t + theta * h_);
    last_theta_ = theta;
    return loop_.next_.y;
  }

  void end_at(double theta, Proposal& p) {  // replace the last step by this partial step
    if (last_theta_ != theta) take(theta);
    p.t_next = loop_.run_.interval.t + theta * h_;
    loop_.run_.grid.undo_step();
  }

  void discard() {
    if (has_saved_end())
      loop_.next_ = std::move(end_), loop_.z_ = z_, loop_.size1_ = size_, loop_.restarted_ = restarted_;
  }

 private:
  bool has_saved_end() const { return !end_.y.empty(); }

  TimeLoop& loop_;
  const double h_;
  const bool restarted_;
  State end_;  // end of the full step, swapped with `next_` of the loop
  Vector z_, size_;
  double last_theta_ = 1;  // fraction of the last partial step
};

}  // namespace mbdae
