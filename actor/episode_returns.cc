#include "actor/episode_returns.h"

#include <cmath>
#include <utility>

#include "core/check.h"
#include "core/returns.h"
#include "core/status_macros.h"

namespace dbr {

EpisodeReturns::EpisodeReturns(const TransitionLayout& layout, int envs, const ReturnOptions& options,
                               TransitionSink sink)
    : layout_(layout), options_(options), sink_(std::move(sink)), episodes_(static_cast<std::size_t>(envs)) {
  DBR_CHECK(layout.return_width == 1);
}

absl::Status EpisodeReturns::Add(int env, const TransitionView& transition, const TransitionValue& value,
                                 const std::optional<EpisodeEnd>& end) {
  Episode& episode = episodes_[static_cast<std::size_t>(env)];
  const std::size_t size = episode.rows.size();
  episode.rows.resize(size + static_cast<std::size_t>(layout_.stride()));
  WriteRow(transition, layout_, episode.rows.data() + size);
  episode.judgements.push_back({value.value, value.critic_version});
  ++held_;
  if (!end.has_value()) return absl::OkStatus();
  FillReturns(layout_, ValueBehind(episode, value.next_value), absl::MakeSpan(episode.rows));
  const absl::Status status = PassOn(episode, *end);
  held_ -= episode.judgements.size();
  episode.rows.clear();
  episode.judgements.clear();
  return status;
}

double EpisodeReturns::ValueBehind(const Episode& episode, float next_value) const {
  const float* const last =
      episode.rows.data() + episode.rows.size() - static_cast<std::size_t>(layout_.stride());
  if (last[layout_.discount_offset()] == 0) return 0;
  if (std::isfinite(next_value)) return next_value / options_.reward_scale;
  return options_.discount < 1 ? StationaryContinuation(layout_, options_.discount, episode.rows) : 0;
}

absl::Status EpisodeReturns::PassOn(const Episode& episode, const EpisodeEnd& end) {
  const std::size_t steps = episode.judgements.size();
  for (std::size_t t = 0; t < steps; ++t) {
    const TransitionView transition =
        ViewRow(episode.rows.data() + t * static_cast<std::size_t>(layout_.stride()), layout_);
    const Judgement& judgement = episode.judgements[t];
    const auto advantage =
        static_cast<float>(options_.reward_scale * transition.monte_carlo_return - judgement.value);
    RETURN_IF_ERROR(sink_(transition, advantage, judgement.critic_version,
                          t + 1 == steps ? std::optional<EpisodeEnd>(end) : std::nullopt));
  }
  return absl::OkStatus();
}

}  // namespace dbr
