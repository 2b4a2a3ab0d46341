#include "deploy/record/recorder.h"

#include <algorithm>
#include <map>
#include <thread>
#include <utility>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"
#include "absl/time/time.h"
#include "actor/policy_fit.h"
#include "actor/vector_env.h"
#include "core/monotonic_clock.h"
#include "core/rng.h"
#include "core/status_macros.h"
#include "envs/registry/registry.h"

namespace dbr {
namespace {

constexpr int kMinGroup = 4;
constexpr int kMaxGroup = 32;
constexpr int kGroupsWanted = 4;  // of the longest episodes in all, so that few steps are played for nothing
constexpr int kGroupsAhead = 4;   // a thread, that wait to be handed on
constexpr std::uint64_t kActingStream = std::uint64_t{1}
                                        << 40;  // plus the group's number; episodes are fewer
constexpr absl::Duration kProgressEvery = absl::Milliseconds(200);

using Group = std::vector<EpisodeRows>;

int GroupSize(std::int64_t steps, int max_episode_steps) {
  const std::int64_t episodes = steps / std::max(1, max_episode_steps);
  return static_cast<int>(std::clamp<std::int64_t>(episodes / kGroupsWanted, kMinGroup, kMaxGroup));
}

// One thread's environments, which play group after group.
class GroupPlayer {
 public:
  static absl::StatusOr<std::unique_ptr<GroupPlayer>> Create(const RecordOptions& options, int group_size) {
    ASSIGN_OR_RETURN(std::unique_ptr<VectorEnv> envs,
                     VectorEnv::Create({.name = options.env, .opponents = {}}, group_size));
    return std::make_unique<GroupPlayer>(options, std::move(envs));
  }

  GroupPlayer(const RecordOptions& options, std::unique_ptr<VectorEnv> envs)
      : options_(options),
        envs_(std::move(envs)),
        rng_(options.seed),
        actions_(MatrixX<float>::Zero(envs_->spec().actions.width(), envs_->size())) {}

  // Episodes group * size to (group + 1) * size - 1; adds to `steps` as it goes; ends early once `stopped`.
  absl::StatusOr<Group> Play(std::int64_t group, const std::atomic<bool>& stopped,
                             std::atomic<std::int64_t>* steps) {
    rng_ = Rng(options_.seed).Fork(kActingStream + group);
    Group episodes(envs_->size());
    std::vector<bool> playing(envs_->size(), true);
    random_.clear();
    for (int i = 0; i < envs_->size(); ++i) {
      const Rng episode_rng = Rng(options_.seed).Fork(group * envs_->size() + i);
      random_.push_back(episode_rng.Fork(0));
      envs_->Reset(i, episode_rng.Fork(1)());
      episodes[i].AddObservation(Column(envs_->observations(), i));
    }
    for (int left = envs_->size(); left > 0 && !stopped;) {
      RETURN_IF_ERROR(ChooseActions());
      *steps += left;
      for (int i = 0; i < envs_->size(); ++i) {
        if (!playing[i] || !Step(i, &episodes[i])) continue;
        playing[i] = false;
        --left;
      }
      envs_->Advance();
    }
    return episodes;
  }

 private:
  absl::Status ChooseActions() {
    if (options_.policy != nullptr) {
      return runner_.Act(*options_.policy, options_.acting, envs_->observations(), envs_->masks(), rng_,
                         actions_);
    }
    for (int i = 0; i < envs_->size(); ++i) {
      for (float& value : MutableColumn(actions_, i))
        value = static_cast<float>(2 * random_[i].Uniform() - 1);
    }
    return absl::OkStatus();
  }

  // Whether the episode is over.
  bool Step(int i, EpisodeRows* episode) {
    const StepResult& result = envs_->Step(i, actions_);
    if (!result.broken) {
      episode->AddAction(Column(actions_, i), result.reward);
      episode->AddObservation(Column(envs_->next_observations(), i));
    }
    if (result.terminated) episode->ending = EpisodeEnding::kTerminal;
    if (result.truncated) episode->ending = EpisodeEnding::kTimeLimit;
    return result.done();
  }

  const RecordOptions& options_;
  const std::unique_ptr<VectorEnv> envs_;
  PolicyRunner runner_;
  Rng rng_;                  // of the group's actions by the policy
  std::vector<Rng> random_;  // [environments] of random actions
  MatrixX<float> actions_;   // [action width x environments]
};

// Threads that play groups, and a queue that puts them back into their order.
class Recording {
 public:
  Recording(const RecordOptions& options, int group_size) : options_(options), group_size_(group_size) {
    const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    const int threads = options.threads > 0 ? options.threads : cores;
    ahead_ = threads * kGroupsAhead;
    for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { PlayGroups(); });
  }

  ~Recording() {
    stopped_ = true;
    {
      absl::MutexLock lock(&mutex_);
      closed_ = true;
    }
    for (std::thread& thread : threads_) thread.join();
  }

  // The next group in order; empty where none was ready within `wait`.
  absl::StatusOr<Group> NextGroup(absl::Duration wait) {
    absl::MutexLock lock(&mutex_);
    AwaitFor(&mutex_, absl::Condition(this, &Recording::NextIsReady), wait);
    RETURN_IF_ERROR(failure_);
    const auto first = ready_.find(next_out_);
    if (first == ready_.end()) return Group();
    Group group = std::move(first->second);
    ready_.erase(first);
    ++next_out_;
    return group;
  }

  std::int64_t steps_played() const { return steps_played_; }

 private:
  bool NextIsReady() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return !failure_.ok() || ready_.count(next_out_) > 0;
  }
  bool MayGoOn() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return closed_ || next_in_ < next_out_ + ahead_;
  }

  // Runs in each thread.
  void PlayGroups() {
    const absl::Status status = TryPlayGroups();
    if (status.ok()) return;
    stopped_ = true;
    absl::MutexLock lock(&mutex_);
    failure_.Update(status);
    closed_ = true;
  }

  absl::Status TryPlayGroups() {
    ASSIGN_OR_RETURN(const std::unique_ptr<GroupPlayer> player, GroupPlayer::Create(options_, group_size_));
    while (true) {
      const std::int64_t number = TakeGroup();
      if (number < 0) return absl::OkStatus();
      ASSIGN_OR_RETURN(Group group, player->Play(number, stopped_, &steps_played_));
      absl::MutexLock lock(&mutex_);
      if (!stopped_) ready_.emplace(number, std::move(group));
    }
  }

  // -1: there is nothing more to do.
  std::int64_t TakeGroup() {
    absl::MutexLock lock(&mutex_);
    mutex_.Await(absl::Condition(this, &Recording::MayGoOn));
    return closed_ ? -1 : next_in_++;
  }

  const RecordOptions& options_;
  const int group_size_;
  std::int64_t ahead_ = 0;
  std::atomic<bool> stopped_ = false;  // what is being played is not needed any more
  std::atomic<std::int64_t> steps_played_ = 0;
  absl::Mutex mutex_;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  absl::Status failure_ ABSL_GUARDED_BY(mutex_);
  std::map<std::int64_t, Group> ready_ ABSL_GUARDED_BY(mutex_);  // by number
  std::int64_t next_in_ ABSL_GUARDED_BY(mutex_) = 0;             // to be played next
  std::int64_t next_out_ ABSL_GUARDED_BY(mutex_) = 0;            // to be handed on next
  std::vector<std::thread> threads_;
};

// Hands on as many steps of `group` as are wanted; subtracts them from `left`.
absl::Status HandOn(const Group& group, const RecordSinks& sinks, std::int64_t* left) {
  for (const EpisodeRows& episode : group) {
    const std::int64_t steps = std::min<std::int64_t>(*left, episode.steps());
    if (steps == 0) continue;  // none is left, or the world failed in the first step
    const EpisodeView view = episode.View();
    RETURN_IF_ERROR(
        sinks.episode(steps == episode.steps() ? view : FirstSteps(view, static_cast<int>(steps))));
    *left -= steps;
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status RecordEpisodes(const RecordOptions& options, const RecordSinks& sinks,
                            const std::atomic<bool>& cancelled) {
  ASSIGN_OR_RETURN(const std::unique_ptr<Env> env, MakeEnv({.name = options.env, .opponents = {}}));
  if (env->spec().actions.discrete()) {
    return absl::InvalidArgumentError(absl::StrCat("expected an environment with continuous actions, found ",
                                                   env->spec().name,
                                                   "; offline data holds no legal-action masks"));
  }
  if (options.policy != nullptr) RETURN_IF_ERROR(CheckPolicyFits(options.policy->spec(), env->spec()));
  Recording recording(options, GroupSize(options.steps, env->spec().max_episode_steps));
  for (std::int64_t left = options.steps; left > 0;) {
    if (cancelled) return absl::CancelledError("the recording was stopped");
    ASSIGN_OR_RETURN(const Group group, recording.NextGroup(kProgressEvery));
    RETURN_IF_ERROR(HandOn(group, sinks, &left));
    sinks.progress(std::min(options.steps, recording.steps_played()));
  }
  return absl::OkStatus();
}

}  // namespace dbr
