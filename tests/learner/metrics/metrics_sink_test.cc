#include "learner/metrics/metrics_sink.h"

#include <gmock/gmock.h>
#include <google/protobuf/unknown_field_set.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "core/crc32c.h"
#include "core/file_io.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using google::protobuf::UnknownFieldSet;
using Json = nlohmann::json;

const absl::Time kStart = absl::FromUnixSeconds(1700000000);

// The parts of an event that TensorBoard shows.
struct Event {
  double wall_time = 0;
  std::uint64_t step = 0;
  std::string file_version;
  std::uint64_t session_status = 0;  // 1: a session starts
  std::map<std::string, float> scalars;
};

template <class T>
T ReadFixed(const std::string& bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

std::uint32_t MaskedCrc(const std::string& bytes) {
  const std::uint32_t crc = Crc32c(bytes.data(), bytes.size());
  return ((crc >> 15) | (crc << 17)) + 0xa282ead8u;
}

template <class To, class From>
To BitsAs(From from) {
  static_assert(sizeof(To) == sizeof(From));
  To to;
  std::memcpy(&to, &from, sizeof to);
  return to;
}

void ReadScalar(const std::string& bytes, Event* event) {
  UnknownFieldSet value;
  ASSERT_TRUE(value.ParseFromString(bytes));
  ASSERT_EQ(value.field_count(), 2);
  ASSERT_EQ(value.field(0).number(), 1);
  ASSERT_EQ(value.field(1).number(), 2);
  event->scalars[value.field(0).length_delimited()] = BitsAs<float>(value.field(1).fixed32());
}

// Reads the Event message by its field numbers: 1 wall_time, 2 step, 3 file_version, 5 summary (1: values), 7
// session_log (1: status).
Event ReadEvent(const std::string& bytes) {
  UnknownFieldSet fields, summary, session;
  EXPECT_TRUE(fields.ParseFromString(bytes));
  Event event;
  for (int i = 0; i < fields.field_count(); ++i) {
    const auto& field = fields.field(i);
    if (field.number() == 1) event.wall_time = BitsAs<double>(field.fixed64());
    if (field.number() == 2) event.step = field.varint();
    if (field.number() == 3) event.file_version = field.length_delimited();
    if (field.number() == 5) {
      EXPECT_TRUE(summary.ParseFromString(field.length_delimited()));
    }
    if (field.number() == 7) {
      EXPECT_TRUE(session.ParseFromString(field.length_delimited()));
      EXPECT_EQ(session.field_count(), 1);
      EXPECT_EQ(session.field(0).number(), 1);
      event.session_status = session.field(0).varint();
    }
  }
  for (int i = 0; i < summary.field_count(); ++i) ReadScalar(summary.field(i).length_delimited(), &event);
  return event;
}

// Reads all events of a file and verifies every checksum.
std::vector<Event> ReadEvents(const std::string& path) {
  const std::string bytes = ReadFile(path).value();
  std::vector<Event> events;
  std::size_t at = 0;
  while (at < bytes.size()) {
    if (bytes.size() - at < 16) {
      ADD_FAILURE() << "a record is cut off at byte " << at;
      break;
    }
    const auto length = ReadFixed<std::uint64_t>(bytes, at);
    EXPECT_EQ(ReadFixed<std::uint32_t>(bytes, at + 8), MaskedCrc(bytes.substr(at, 8)));
    if (length > bytes.size() - at - 16) {
      ADD_FAILURE() << "a record of " << length << " bytes is cut off at byte " << at;
      break;
    }
    const std::string payload = bytes.substr(at + 12, length);
    EXPECT_EQ(ReadFixed<std::uint32_t>(bytes, at + 12 + length), MaskedCrc(payload));
    events.push_back(ReadEvent(payload));
    at += 16 + length;
  }
  return events;
}

class MetricsSinkTest : public testing::Test {
 protected:
  std::unique_ptr<MetricsSink> Open(absl::Time now = kStart, absl::Duration interval = absl::Seconds(10)) {
    auto sink = MetricsSink::Open(run_, interval, now, [this] { return clock_; });
    EXPECT_TRUE(sink.ok()) << sink.status();
    return sink.ok() ? *std::move(sink) : nullptr;
  }
  std::vector<Json> Rows() const {
    std::vector<Json> rows;
    std::ifstream stream(run_.metrics());
    for (std::string line; std::getline(stream, line);) {
      rows.push_back(Json::parse(line, nullptr, /*allow_exceptions=*/false));
      EXPECT_TRUE(rows.back().is_object()) << line;
    }
    return rows;
  }
  std::vector<std::string> EventFiles() const {
    std::vector<std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      if (entry.path().filename().string().rfind("events.out.tfevents.", 0) == 0)
        files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    return files;
  }

  const TempDir folder_;
  const RunFolder run_{folder_.path()};
  absl::Time clock_ = absl::UnixEpoch();  // that intervals go by
};

TEST_F(MetricsSinkTest, WritesEachRowToBothFiles) {
  const auto sink = Open();
  ASSERT_TRUE(
      sink->Write(500, kStart + absl::Milliseconds(1500), {{tags::kActorLoss, 0.1}, {"dbr/alpha", -2}}).ok());
  ASSERT_TRUE(sink->Write(1000, kStart + absl::Seconds(3), {{tags::kActorLoss, 0.2}}).ok());
  ASSERT_TRUE(sink->Flush().ok());
  const auto rows = Rows();
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(
      rows[0],
      Json({{"step", 500}, {"wall_time", 1700000001.5}, {"train/actor_loss", 0.1}, {"dbr/alpha", -2.0}}));
  EXPECT_EQ(rows[1]["train/actor_loss"], 0.2);
  ASSERT_EQ(EventFiles().size(), 1u);
  const auto events = ReadEvents(EventFiles()[0]);
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[0].file_version, "brain.Event:2");
  EXPECT_EQ(events[1].step, 500u);
  EXPECT_EQ(events[1].wall_time, 1700000001.5);
  EXPECT_EQ(events[1].scalars,
            (std::map<std::string, float>{{"train/actor_loss", 0.1f}, {"dbr/alpha", -2.0f}}));
  EXPECT_EQ(events[2].step, 1000u);
}

// The framing and the fields byte by byte, so that a change of the schema or of the library is seen.
TEST(EventFileTest, ARecordIsTheBytesThatTensorBoardExpects) {
  const std::string event(
      "\x09\x00\x00\x00\x00\x00\x00\xf8\x3f"  // 1, fixed64: wall_time 1.5
      "\x10\xac\x02"                          // 2, varint: step 300
      "\x2a\x14"                              // 5, 20 bytes: summary
      "\x0a\x08\x0a\x01"                      // 1, 8 bytes: a value; its 1, one byte: tag
      "a\x15\x00\x00\x80\x3f"                 // 2, fixed32: simple_value 1
      "\x0a\x08\x0a\x01"                      // as before
      "b\x15\x00\x00\x00\x00",                // simple_value 0, which is written too
      9 + 3 + 2 + 4 + 6 + 4 + 6);
  const std::string record = ScalarRecord(300, 1.5, {{"a", 1}, {"b", 0}});
  ASSERT_EQ(record.size(), 16 + event.size());
  EXPECT_EQ(ReadFixed<std::uint64_t>(record, 0), event.size());
  EXPECT_EQ(ReadFixed<std::uint32_t>(record, 8), MaskedCrc(record.substr(0, 8)));
  EXPECT_EQ(record.substr(12, event.size()), event);
  EXPECT_EQ(ReadFixed<std::uint32_t>(record, 12 + event.size()), MaskedCrc(event));
}

TEST_F(MetricsSinkTest, WhatIsNotFiniteIsNull) {
  const auto sink = Open();
  ASSERT_TRUE(sink->Write(1, kStart,
                          {{"a", std::numeric_limits<double>::quiet_NaN()},
                           {"b", -std::numeric_limits<double>::infinity()}})
                  .ok());
  ASSERT_TRUE(sink->Flush().ok());
  ASSERT_EQ(Rows().size(), 1u);
  EXPECT_TRUE(Rows()[0]["a"].is_null() && Rows()[0]["b"].is_null());
}

TEST_F(MetricsSinkTest, WritesOutAfterTheInterval) {
  const auto sink = Open();
  clock_ += absl::Seconds(9);
  ASSERT_TRUE(sink->Write(1, kStart, {{"a", 1}}).ok());
  EXPECT_EQ(Rows().size(), 0u);
  clock_ += absl::Seconds(1);
  ASSERT_TRUE(sink->Write(2, kStart - absl::Hours(2), {{"a", 2}}).ok());
  EXPECT_EQ(Rows().size(), 2u) << "the time of day counts for nothing but the rows' labels";
  clock_ += absl::Seconds(9);
  ASSERT_TRUE(sink->Write(3, kStart + absl::Hours(2), {{"a", 3}}).ok());
  EXPECT_EQ(Rows().size(), 2u);
}

TEST_F(MetricsSinkTest, TheDestructorWritesWhatIsLeft) {
  Open()->Write(1, kStart, {{"a", 1}}).IgnoreError();
  EXPECT_EQ(Rows().size(), 1u);
}

TEST_F(MetricsSinkTest, AResumedRunGoesOnWithItsRowsAndAnEventFileOfItsOwn) {
  Open()->Write(1, kStart, {{"a", 1}}).IgnoreError();
  std::ofstream(run_.metrics(), std::ios::app) << R"({"step":2,"wall_ti)";  // as a killed process leaves it
  Open(kStart + absl::Seconds(100))->Write(3, kStart + absl::Seconds(101), {{"a", 3}}).IgnoreError();
  const auto rows = Rows();
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0]["step"], 1);
  EXPECT_EQ(rows[1]["step"], 3);
  const auto files = EventFiles();
  ASSERT_EQ(files.size(), 2u);
  for (const std::string& file : files) EXPECT_EQ(ReadEvents(file).size(), 2u);
}

TEST_F(MetricsSinkTest, ASessionBeginsWithTheStepThatItGoesOnFrom) {
  const auto sink = Open();
  ASSERT_TRUE(sink->StartSession(3320, kStart).ok());
  ASSERT_TRUE(sink->Write(3340, kStart, {{tags::kActorLoss, 0.1}}).ok());
  ASSERT_TRUE(sink->Flush().ok());
  const auto events = ReadEvents(EventFiles().at(0));
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[0].file_version, "brain.Event:2");
  EXPECT_EQ(events[1].session_status, 1u);
  EXPECT_EQ(events[1].step, 3320u);
  EXPECT_TRUE(events[1].scalars.empty());
  EXPECT_EQ(events[2].step, 3340u);
  EXPECT_EQ(Rows().size(), 1u) << "metrics.jsonl has no line for it";
}

// What TensorBoard shows of a run: it reads the files in order, and a start drops what lies at its step and
// behind, of every tag.
std::map<std::string, std::map<std::uint64_t, float>> Shown(const std::vector<std::string>& files) {
  std::map<std::string, std::map<std::uint64_t, float>> shown;
  for (const std::string& file : files) {
    for (const Event& event : ReadEvents(file)) {
      if (event.session_status == 1) {
        for (auto& [tag, values] : shown) values.erase(values.lower_bound(event.step), values.end());
      }
      for (const auto& [tag, value] : event.scalars) shown[tag][event.step] = value;
    }
  }
  return shown;
}

TEST_F(MetricsSinkTest, AResumedSessionDropsWhatTheLearnerMakesAgainAndNothingElse) {
  const auto train = [](double loss) { return Scalars{{tags::kActorLoss, loss}}; };
  const auto rollout = [](double step) {
    return Scalars{{tags::kTransitions, step}, {tags::kEpisodeReturn, step / 2}};
  };
  {
    const auto killed = Open();
    ASSERT_TRUE(killed->StartSession(0, kStart).ok());
    for (const int step : {10, 20, 30, 40}) ASSERT_TRUE(killed->Write(step, kStart, train(step)).ok());
    for (const int step : {5, 15, 1000, 2000}) ASSERT_TRUE(killed->Write(step, kStart, rollout(step)).ok());
  }
  std::ofstream(run_.metrics(), std::ios::app) << "{}\nno row\n";
  {
    const auto resumed = Open(kStart + absl::Seconds(10));
    ASSERT_TRUE(resumed->StartSession(20, kStart + absl::Seconds(10)).ok());
    ASSERT_TRUE(resumed->Write(30, kStart, train(33)).ok());
    ASSERT_TRUE(resumed->Write(3000, kStart, rollout(3000)).ok());
  }
  auto shown = Shown(EventFiles());
  EXPECT_EQ(shown[tags::kActorLoss], (std::map<std::uint64_t, float>{{10, 10}, {20, 20}, {30, 33}}));
  EXPECT_EQ(shown[tags::kEpisodeReturn],
            (std::map<std::uint64_t, float>{{5, 2.5f}, {15, 7.5f}, {1000, 500}, {2000, 1000}, {3000, 1500}}));
}

TEST_F(MetricsSinkTest, AFullDiskIsSaidAndTheRowsAreKept) {
  std::filesystem::create_symlink("/dev/full", run_.metrics());
  const auto sink = Open();
  ASSERT_NE(sink, nullptr);
  ASSERT_TRUE(sink->Write(1, kStart, {{"a", 1}}).ok());
  const absl::Status status = sink->Flush();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr(run_.metrics()));
  EXPECT_EQ(sink->Flush().code(), absl::StatusCode::kResourceExhausted) << "the row must still be pending";
  EXPECT_EQ(ReadEvents(EventFiles().at(0)).size(), 2u) << "the other file gets its row once";
}

TEST_F(MetricsSinkTest, AMissingFolderIsNotFound) {
  const auto sink = MetricsSink::Open({folder_ / "none"}, absl::Seconds(1), kStart);
  EXPECT_EQ(sink.status().code(), absl::StatusCode::kNotFound);
}

TEST_F(MetricsSinkTest, ThreadsMixWholeRows) {
  constexpr int kThreads = 4, kRows = 200;
  const auto sink = Open(kStart, absl::ZeroDuration());
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < kRows; ++i) EXPECT_TRUE(sink->Write(t * kRows + i, kStart, {{"a", i}}).ok());
    });
  }
  for (std::thread& thread : threads) thread.join();
  ASSERT_TRUE(sink->Flush().ok());
  std::vector<int> steps;
  for (const Json& row : Rows()) steps.push_back(row["step"].get<int>());
  std::sort(steps.begin(), steps.end());
  ASSERT_EQ(steps.size(), static_cast<std::size_t>(kThreads * kRows));
  for (int i = 0; i < kThreads * kRows; ++i) EXPECT_EQ(steps[i], i);
  EXPECT_EQ(ReadEvents(EventFiles().at(0)).size(), static_cast<std::size_t>(kThreads * kRows + 1));
}

}  // namespace
}  // namespace dbr
