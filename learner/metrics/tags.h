// The names of a run's figures.
#pragma once

namespace dbr {

// Tags that Stable-Baselines3 gives the same quantities, so that its users' dashboards fit. Other tags begin
// with who measured: "replay/total", "learner/starved_share".
namespace tags {
inline constexpr char kEpisodeReturn[] = "rollout/ep_rew_mean";
inline constexpr char kEpisodeLength[] = "rollout/ep_len_mean";
inline constexpr char kEpisodeScore[] = "rollout/success_rate";
inline constexpr char kTransitionsPerSecond[] = "time/fps";
inline constexpr char kEpisodes[] = "time/episodes";
inline constexpr char kTransitions[] = "time/total_timesteps";
inline constexpr char kActorLoss[] = "train/actor_loss";
inline constexpr char kCriticLoss[] = "train/critic_loss";
inline constexpr char kUpdates[] = "train/n_updates";
inline constexpr char kEvaluationReturn[] = "eval/mean_reward";
inline constexpr char kEvaluationScore[] = "eval/success_rate";
}  // namespace tags

}  // namespace dbr
