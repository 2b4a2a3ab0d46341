// n-step transitions, made of the single steps of an episode.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "core/check.h"
#include "core/status_macros.h"
#include "core/transition.h"

namespace dbr {

// What travels with a transition from the step that it starts with.
struct FirstJudgement {
  float advantage = kUnjudged;  // Q(s, a) - V(s)
  std::uint64_t critic_version = 0;
};

// Takes the steps of an episode in their order and gives a transition for each of them, in the same order:
//
//   (s_t, a_t, sum_{k<m} gamma^k r_{t+k}, gamma^m, s_{t+m}),   m = n, or fewer where the episode ends before
//
// (Sutton and Barto 2018, equation 7.1, without the value of s_{t+m}). gamma is the discount of each single
// step. The step that ends the task has discount 0, and with it each transition that reaches the end; one
// that reaches a cut continues with the last observation of the cut episode. A step's own return stays with
// the transition that it starts. Sums and products are made in double and rounded once. With n = 1 each step
// is passed through as it is. Holds the last n - 1 steps; allocates in its constructor alone. One thread at a
// time.
class NStepAccumulator {
 public:
  // Requires n >= 1.
  NStepAccumulator(const TransitionLayout& layout, int n)
      : layout_(layout), starts_(static_cast<std::size_t>(n)) {
    DBR_CHECK(n >= 1);
    if (n > 1) rows_.resize(starts_.size() * static_cast<std::size_t>(layout.stride()));
  }

  // Takes the next step. Calls emit(transition, judgement, is_last) for each transition that is complete with
  // it: the one that started n - 1 steps before, and where `ends` is true (the episode ends with this step)
  // all that wait. `is_last` is true for the transition that this last step starts. A transition's memory is
  // valid during the call. Returns emit's first error; the transitions after it still wait. O(n).
  template <class Emit>
  absl::Status Add(const TransitionView& step, const FirstJudgement& judgement, bool ends, Emit&& emit) {
    if (starts_.size() == 1) return emit(step, judgement, ends);
    for (std::size_t i = 0; i < waiting_; ++i) {
      Start& start = starts_[Slot(i)];
      start.reward += start.discount * step.reward;
      start.discount *= step.discount;
    }
    const std::size_t slot = Slot(waiting_++);
    starts_[slot] = {step.reward, step.discount, judgement};
    WriteRow(step, layout_, Row(slot));
    if (ends) return EmitAll(/*ends=*/true, emit);
    return waiting_ == starts_.size() ? EmitOldest(/*is_last=*/false, emit) : absl::OkStatus();
  }

  // Emits all that wait as transitions of fewer steps, which continue with the newest step's next state: what
  // comes next does not follow. Returns emit's first error. The next step starts anew.
  template <class Emit>
  absl::Status Flush(Emit&& emit) {
    return EmitAll(/*ends=*/false, emit);
  }

  // The number of steps that wait, and the newest of them, in the accumulator's memory. Requires that there
  // is one.
  std::size_t waiting() const { return waiting_; }
  TransitionView newest() const { return ViewRow(Row(Slot(waiting_ - 1)), layout_); }

 private:
  // The sums of a transition that waits for further steps.
  struct Start {
    double reward = 0;
    double discount = 0;
    FirstJudgement judgement;
  };

  std::size_t Slot(std::size_t i) const { return (oldest_ + i) % starts_.size(); }
  float* Row(std::size_t slot) { return rows_.data() + slot * static_cast<std::size_t>(layout_.stride()); }
  const float* Row(std::size_t slot) const {
    return rows_.data() + slot * static_cast<std::size_t>(layout_.stride());
  }

  template <class Emit>
  absl::Status EmitAll(bool ends, Emit& emit) {
    while (waiting_ > 0) RETURN_IF_ERROR(EmitOldest(ends && waiting_ == 1, emit));
    return absl::OkStatus();
  }

  // The oldest start's row with its sums, and with the newest step's next state.
  template <class Emit>
  absl::Status EmitOldest(bool is_last, Emit& emit) {
    const TransitionView last = newest();
    const Start& start = starts_[oldest_];
    TransitionView transition = ViewRow(Row(oldest_), layout_);
    transition.reward = static_cast<float>(start.reward);
    transition.discount = static_cast<float>(start.discount);
    transition.next_observation = last.next_observation;
    transition.next_mask = last.next_mask;
    transition.next_action = last.next_action;
    oldest_ = Slot(1);
    --waiting_;
    return emit(transition, start.judgement, is_last);
  }

  const TransitionLayout layout_;
  std::vector<Start> starts_;  // [n], a ring of those that wait
  std::vector<float> rows_;    // [n x stride], their steps; empty where n is 1
  std::size_t oldest_ = 0;
  std::size_t waiting_ = 0;
};

}  // namespace dbr
