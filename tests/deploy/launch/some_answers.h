// Answers of the services and results, as the tests of what is made of them need them.
#pragma once

#include <limits>
#include <string>

#include "actor/evaluator.h"
#include "proto/policy.pb.h"
#include "proto/replay.pb.h"

namespace dbr {

inline StatsReply SomeStats() {
  StatsReply stats;
  stats.set_total(100000);
  stats.set_plus(60000);
  stats.set_minus(41000);
  stats.set_capacity(300000);
  stats.set_bytes(80u << 20);
  stats.set_inserted(123456);
  stats.set_insert_rate(5120);
  stats.set_samples_per_insert(3.97);
  stats.set_episodes(12345);
  stats.set_recent_score_mean(std::numeric_limits<double>::quiet_NaN());
  for (const double edge : {-1.0, 0.0, 1.0}) stats.add_advantage_edges(edge);
  for (const int count : {40000, 60000}) stats.add_advantage_histogram(count);
  WriterStats* writer = stats.add_writers();
  writer->set_name("actor-0");
  writer->set_inserted(123456);
  writer->set_last_sequence(123456);
  writer->set_held(100000);
  BlockedClients* blocked = stats.add_blocked();
  blocked->set_call("sample");
  blocked->set_clients(1);
  blocked->set_why("the rate limiter waits for inserts");
  LatencyStats* latency = stats.add_latencies();
  latency->set_call("sample");
  latency->set_count(10);
  latency->set_p50_us(250);
  latency->set_p99_us(1200);
  return stats;
}

inline LearnerStatus SomeStatus() {
  LearnerStatus status;
  status.set_updates(4000);
  status.set_matrix_products("a library, bfloat16");
  status.set_policy_version(82);
  status.set_updates_per_second(410);
  status.set_subscribers(2);
  status.set_oldest_subscriber_version(80);
  EvaluationReport* report = status.add_evaluations();
  report->set_opponent("random");
  report->set_score_mean(0.934);
  return status;
}

inline EvaluationResult Against(const std::string& opponent, double score) {
  return {.env = "connect4",
          .opponent = opponent,
          .episodes = 1000,
          .seed = 3,
          .score_mean = score,
          .score_stderr = 0.005,
          .return_mean = 2 * score - 1,
          .return_stderr = 0.01};
}

}  // namespace dbr
