#include "tests/deploy/report/fake_experiment.h"

#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/check.h"
#include "core/file_io.h"
#include "deploy/launch/results.h"
#include "proto/config/config_file.h"

namespace dbr {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr int kEvaluations = 20;

void Write(const std::string& path, absl::string_view text) {
  DBR_CHECK(WriteFileAtomically(path, text).ok());
}

RunSummary Finished(std::uint64_t seed) {
  RunSummary summary;
  summary.seed = seed;
  summary.algorithm = "dbr";
  summary.commit = "0123456789abcdef0123456789abcdef01234567";
  summary.matrix_products = "a library, float32";
  summary.final_policy = "average";
  summary.ended = RunEnding::kMaxUpdates;
  summary.wall_s = 3723;
  summary.updates = 30000;
  return summary;
}

}  // namespace

std::string FakeGrid() {
  return R"grid(
name: "fake"
task {
  name: "hopper-medium"
  label: "Hopper (offline, medium)"
  kind: OFFLINE
  measure {
    published { contender: "dbr" mean: 17.3 std: 6 }
    published { contender: "bear" mean: 16.1 std: 2.97 }
  }
}
task {
  name: "connect4"
  label: "Connect 4"
  kind: GAMES
  measure {
    label: "Connect 4 - random"
    opponent: "random"
    published { contender: "dbr" mean: 0.982 std: 0.0158 }
  }
  measure { label: "Connect 4 - MCTS 10" opponent: "mcts:10" }
}
contender { name: "dbr" label: "DBR" task: "*" }
contender { name: "bear" label: "BEAR" task: "*" }
contender { name: "dbr-fixed" label: "ARM <fixed>" task: "hopper-*" ablation_of: "dbr" }
scale { name: "short" seeds: 2 }
)grid";
}

void WriteFakeExperiment(const std::string& root) {
  std::filesystem::create_directories(root);
  Write(root + "/experiment.textproto", FakeGrid());
  Write(root + "/scale.txt", "short\n");
}

RunSummary FakeHopper(double mean_return, std::uint64_t seed) {
  RunSummary summary = Finished(seed);
  summary.env = "hopper";
  summary.seed_buffer = {.path = "medium.hdf5", .rows = 1000, .episodes = 1, .return_mean = 1078};
  summary.offline_updates = summary.updates;
  std::vector<EvaluationPoint> points;
  for (int i = 1; i <= kEvaluations; ++i) {
    points.push_back({.opponent = "",
                      .updates = static_cast<std::uint64_t>(1500 * i),
                      .episodes = 100,
                      .return_mean = mean_return * (1 - std::exp(-0.3 * i)) + 3.0 * seed,
                      .return_std = 10});
  }
  summary.curve = EvaluationCurve(std::move(points));
  summary.final_results = {{.env = "hopper",
                            .opponent = "",
                            .episodes = 1000,
                            .seed = seed,
                            .score_mean = kNaN,
                            .score_stderr = kNaN,
                            .return_mean = mean_return,
                            .return_stderr = 1,
                            .return_std = 30,
                            .length_mean = 900}};
  return summary;
}

RunSummary FakeGames(double random_score, double mcts_score, std::uint64_t seed) {
  RunSummary summary = Finished(seed);
  summary.env = "connect4";
  summary.games = 500000;
  std::vector<EvaluationPoint> points;
  for (int i = 1; i <= kEvaluations; ++i) {
    for (const auto& [opponent, score] :
         {std::pair("random", random_score), std::pair("mcts:10", mcts_score)}) {
      points.push_back({.opponent = opponent,
                        .updates = static_cast<std::uint64_t>(1500 * i),
                        .episodes = 200,
                        .score_mean = 0.5 + (score - 0.5) * (1 - std::exp(-0.2 * i)),
                        .score_stderr = 0.01,
                        .return_mean = 0});
    }
  }
  summary.curve = EvaluationCurve(std::move(points));
  for (const auto& [opponent, score] :
       {std::pair("random", random_score), std::pair("mcts:10", mcts_score)}) {
    summary.final_results.push_back(
        {.env = "connect4", .opponent = opponent, .episodes = 1000, .seed = seed, .score_mean = score});
  }
  return summary;
}

void WriteFakeCell(const std::string& root, const std::string& task, const std::string& contender,
                   const RunSummary& summary) {
  const RunFolder folder{absl::StrCat(root, "/", task, "/", contender, "/seed-", summary.seed)};
  std::filesystem::create_directories(folder.root);
  DBR_CHECK(WriteSummary(summary, folder).ok());
  Config config;
  config.set_seed(summary.seed);
  config.mutable_env()->set_name(summary.env);
  config.mutable_learner()->set_max_updates(summary.updates);
  config.mutable_algorithm()->mutable_dbr()->set_constraint(DbrConfig::FIXED);
  Write(folder.config(), PrintConfig(config));
}

}  // namespace dbr
