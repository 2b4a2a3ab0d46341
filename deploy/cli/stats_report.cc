#include "deploy/cli/stats_report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "deploy/terminal/terminal.h"

namespace dbr {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kBar = 24;

double Ratio(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

std::string Percent(double share) {
  return absl::StrFormat("%3.0f%%", 100 * share);
}

const char* SourceName(TransitionSource source) {
  return source == SEED_BUFFER ? "seed_buffer" : "online";
}

std::string SizeLine(const char* name, std::uint64_t size, std::uint64_t whole, absl::string_view of) {
  return absl::StrCat("  ", PadRight(name, 11), PadLeft(WithCommas(size), 13), "  ",
                      Bar(Ratio(size, whole), kBar), " ", Percent(Ratio(size, whole)), " of ", of, "\n");
}

std::string Sizes(const StatsReply& stats) {
  return absl::StrCat(SizeLine("D", stats.total(), stats.capacity(),
                               absl::StrCat(WithCommas(stats.capacity()), ", ", Bytes(stats.bytes()))),
                      SizeLine("D+", stats.plus(), stats.total(), "D"),
                      SizeLine("D-", stats.minus(), stats.total(), "D"),
                      SizeLine("not judged", stats.unjudged(), stats.total(), "D"));
}

std::string CountLine(const char* name, std::uint64_t count, double rate, const std::string& rest) {
  return absl::StrCat("  ", PadRight(name, 11), PadLeft(WithCommas(count), 13), PadLeft(Compact(rate), 8),
                      "/s", rest, "\n");
}

std::string Counters(const StatsReply& stats) {
  std::string text =
      CountLine("inserted", stats.inserted(), stats.insert_rate(),
                absl::StrCat("   ", WithCommas(stats.evicted()), " evicted, ", WithCommas(stats.refused()),
                             " refused, ", WithCommas(stats.duplicates()), " sent twice"));
  absl::StrAppend(
      &text, CountLine("sampled", stats.sampled(), stats.sample_rate(),
                       absl::StrCat("   ", Fixed(stats.samples_per_insert(), 2), " samples per insert")));
  absl::StrAppend(
      &text, CountLine("relabelled", stats.relabelled(), stats.relabel_rate(),
                       absl::StrCat("   ", WithCommas(stats.relabel_evicted()), " came for evicted ones, ",
                                    WithCommas(stats.relabel_stale()), " too late")));
  absl::StrAppend(&text, "  labels     ", Fixed(stats.label_age_mean(), 1),
                  " critic versions old on average, ", Fixed(stats.label_age_p95(), 1),
                  " at the 95th percentile\n");
  absl::StrAppend(&text, "  episodes   ", WithCommas(stats.episodes()), "; the last 1,000: score ",
                  Fixed(stats.recent_score_mean(), 3), ", return ", Fixed(stats.recent_return_mean(), 3),
                  ", ", Fixed(stats.recent_length_mean(), 1), " steps\n");
  return text;
}

std::string Histogram(const StatsReply& stats) {
  const int bins = std::min(stats.advantage_histogram_size(), stats.advantage_edges_size() - 1);
  if (bins <= 0) return "";
  std::uint64_t largest = 0;
  std::uint64_t sum = 0;
  for (int i = 0; i < bins; ++i) {
    largest = std::max<std::uint64_t>(largest, stats.advantage_histogram(i));
    sum += stats.advantage_histogram(i);
  }
  const auto edge = [](double value) {
    if (std::isinf(value)) return std::string(value < 0 ? "-∞" : "∞");
    return absl::StrFormat("%.4g", value);
  };
  std::string text = "\nadvantages\n";
  for (int i = 0; i < bins; ++i) {
    const std::uint64_t count = stats.advantage_histogram(i);
    absl::StrAppend(&text, "  [", PadLeft(edge(stats.advantage_edges(i)), 7), ", ",
                    PadLeft(edge(stats.advantage_edges(i + 1)), 7), ")  ", Bar(Ratio(count, largest), kBar),
                    " ", PadLeft(WithCommas(count), 11), " ", Percent(Ratio(count, sum)), "\n");
  }
  return text;
}

std::string SourceLine(const char* name, std::uint64_t of_d, std::uint64_t of_plus, std::uint64_t of_minus,
                       const StatsReply& stats) {
  return absl::StrCat("  ", PadRight(name, 11), PadLeft(WithCommas(of_d), 13), "  ",
                      Percent(Ratio(of_d, stats.total())), " of D, ", Percent(Ratio(of_plus, stats.plus())),
                      " of D+, ", Percent(Ratio(of_minus, stats.minus())), " of D-\n");
}

std::string Sources(const StatsReply& stats) {
  std::string text = absl::StrCat(
      "\nsources\n",
      SourceLine("online", stats.total() - stats.seed_buffer(), stats.plus() - stats.seed_buffer_plus(),
                 stats.minus() - stats.seed_buffer_minus(), stats),
      SourceLine("seed_buffer", stats.seed_buffer(), stats.seed_buffer_plus(), stats.seed_buffer_minus(),
                 stats));
  if (stats.seed_buffer_rows() == 0) return text;
  absl::StrAppend(&text, "             ", WithCommas(stats.seed_buffer_rows()), " transitions came in at ",
                  Compact(stats.seed_buffer_rows_per_second()), " rows/s, ",
                  WithCommas(stats.seed_buffer_bad_rows()), " bad rows left out;\n             ",
                  WithCommas(stats.seed_buffer_episodes()), " whole episodes with a return of ",
                  Fixed(stats.seed_buffer_return_mean(), 1), " ± ", Fixed(stats.seed_buffer_return_std(), 1),
                  " (", Fixed(stats.seed_buffer_return_min(), 1), " to ",
                  Fixed(stats.seed_buffer_return_max(), 1), ")\n");
  if (stats.seed_buffer_actions_outside() > 0) {
    absl::StrAppend(&text, "             ", WithCommas(stats.seed_buffer_actions_outside()),
                    " rows have actions outside [-1, 1]\n");
  }
  return text;
}

std::string Writers(const StatsReply& stats) {
  std::string text = Sources(stats);
  if (stats.writers_size() == 0) return text;
  absl::StrAppend(&text, "writers       source      inserted          held          sent twice   refused\n");
  for (const WriterStats& writer : stats.writers()) {
    absl::StrAppend(&text, "  ", PadRight(writer.name(), 12), PadRight(SourceName(writer.source()), 8),
                    PadLeft(WithCommas(writer.inserted()), 12), PadLeft(WithCommas(writer.held()), 12), " ",
                    Percent(Ratio(writer.held(), stats.total())),
                    PadLeft(WithCommas(writer.duplicates()), 12), PadLeft(WithCommas(writer.refused()), 10),
                    writer.connected() || writer.source() == SEED_BUFFER ? "" : "   gone", "\n");
  }
  return text;
}

std::string Latency(double microseconds) {
  return microseconds < 999.5 ? absl::StrFormat("%.0f us", microseconds)
                              : absl::StrFormat("%.1f ms", microseconds / 1000);
}

std::string Calls(const StatsReply& stats) {
  std::string text = "\n";
  if (stats.latencies_size() > 0) text += "calls              count       p50         p99\n";
  for (const LatencyStats& call : stats.latencies()) {
    absl::StrAppend(&text, "  ", PadRight(call.call(), 10), PadLeft(WithCommas(call.count()), 12),
                    PadLeft(Latency(call.p50_us()), 10), PadLeft(Latency(call.p99_us()), 12), "\n");
  }
  if (stats.blocked_size() == 0) return absl::StrCat(text, "no client waits\n");
  for (const BlockedClients& blocked : stats.blocked()) {
    absl::StrAppend(&text, blocked.clients(), blocked.clients() == 1 ? " client waits" : " clients wait",
                    " to ", blocked.call(), ": ", blocked.why(), "\n");
  }
  return text;
}

Json Number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json WritersJson(const StatsReply& stats) {
  Json list = Json::array();
  for (const WriterStats& writer : stats.writers()) {
    list.push_back({{"name", writer.name()},
                    {"id", writer.id()},
                    {"source", SourceName(writer.source())},
                    {"inserted", writer.inserted()},
                    {"last_sequence", writer.last_sequence()},
                    {"duplicates", writer.duplicates()},
                    {"refused", writer.refused()},
                    {"held", writer.held()},
                    {"share", Ratio(writer.held(), stats.total())},
                    {"connected", writer.connected()}});
  }
  return list;
}

Json SourcesJson(const StatsReply& stats) {
  const auto source = [&stats](std::uint64_t total, std::uint64_t plus, std::uint64_t minus) {
    return Json{{"total", total},
                {"plus", plus},
                {"minus", minus},
                {"share", Ratio(total, stats.total())},
                {"plus_share", Ratio(plus, stats.plus())},
                {"minus_share", Ratio(minus, stats.minus())}};
  };
  return {{"online", source(stats.total() - stats.seed_buffer(), stats.plus() - stats.seed_buffer_plus(),
                            stats.minus() - stats.seed_buffer_minus())},
          {"seed_buffer", source(stats.seed_buffer(), stats.seed_buffer_plus(), stats.seed_buffer_minus())}};
}

Json SeedBufferJson(const StatsReply& stats) {
  return {{"seed_buffer_rows", stats.seed_buffer_rows()},
          {"seed_buffer_bad_rows", stats.seed_buffer_bad_rows()},
          {"seed_buffer_episodes", stats.seed_buffer_episodes()},
          {"seed_buffer_return_mean", Number(stats.seed_buffer_return_mean())},
          {"seed_buffer_return_std", Number(stats.seed_buffer_return_std())},
          {"seed_buffer_return_min", Number(stats.seed_buffer_return_min())},
          {"seed_buffer_return_max", Number(stats.seed_buffer_return_max())},
          {"seed_buffer_rows_per_second", Number(stats.seed_buffer_rows_per_second())},
          {"seed_buffer_actions_outside", stats.seed_buffer_actions_outside()}};
}

Json EdgesJson(const StatsReply& stats) {
  Json list = Json::array();
  for (const double edge : stats.advantage_edges()) list.push_back(Number(edge));
  return list;
}

Json BlockedJson(const StatsReply& stats) {
  Json list = Json::array();
  for (const BlockedClients& blocked : stats.blocked()) {
    list.push_back({{"call", blocked.call()}, {"clients", blocked.clients()}, {"why", blocked.why()}});
  }
  return list;
}

Json LatenciesJson(const StatsReply& stats) {
  Json list = Json::array();
  for (const LatencyStats& call : stats.latencies()) {
    list.push_back({{"call", call.call()},
                    {"count", call.count()},
                    {"p50_us", Number(call.p50_us())},
                    {"p99_us", Number(call.p99_us())}});
  }
  return list;
}

}  // namespace

std::string StatsText(const std::string& address, const StatsReply& stats) {
  return absl::StrCat("replay server ", address, ", up ", Clock(absl::Seconds(stats.uptime_s())), "\n\n",
                      Sizes(stats), "\n", Counters(stats), Histogram(stats), Writers(stats), Calls(stats));
}

Json ToJson(const StatsReply& stats) {
  Json json = {{"total", stats.total()},
               {"plus", stats.plus()},
               {"minus", stats.minus()},
               {"unjudged", stats.unjudged()},
               {"inserted", stats.inserted()},
               {"sampled", stats.sampled()},
               {"evicted", stats.evicted()},
               {"relabelled", stats.relabelled()},
               {"relabel_evicted", stats.relabel_evicted()},
               {"relabel_stale", stats.relabel_stale()},
               {"refused", stats.refused()},
               {"duplicates", stats.duplicates()},
               {"seed_buffer", stats.seed_buffer()},
               {"seed_buffer_plus", stats.seed_buffer_plus()},
               {"seed_buffer_minus", stats.seed_buffer_minus()},
               {"sampled_offline", stats.sampled_offline()},
               {"capacity", stats.capacity()},
               {"bytes", stats.bytes()},
               {"insert_rate", Number(stats.insert_rate())},
               {"sample_rate", Number(stats.sample_rate())},
               {"relabel_rate", Number(stats.relabel_rate())},
               {"samples_per_insert", Number(stats.samples_per_insert())},
               {"label_age_mean", Number(stats.label_age_mean())},
               {"label_age_p95", Number(stats.label_age_p95())},
               {"episodes", stats.episodes()},
               {"recent_return_mean", Number(stats.recent_return_mean())},
               {"recent_score_mean", Number(stats.recent_score_mean())},
               {"recent_length_mean", Number(stats.recent_length_mean())},
               {"uptime_s", Number(stats.uptime_s())}};
  json["advantage_edges"] = EdgesJson(stats);
  json["advantage_histogram"] = stats.advantage_histogram();
  json.update(SeedBufferJson(stats));
  json["sources"] = SourcesJson(stats);
  json["writers"] = WritersJson(stats);
  json["blocked"] = BlockedJson(stats);
  json["latencies"] = LatenciesJson(stats);
  return json;
}

}  // namespace dbr
