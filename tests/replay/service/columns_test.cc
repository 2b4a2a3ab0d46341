// Every column of core/columns.h on its way through the replay: encoded, stored, drawn, and in a batch again.
#include "core/columns.h"

#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "core/batch.h"
#include "proto/rpc/codec.h"
#include "replay/buffer/partitioned_buffer.h"
#include "replay/service/service_codec.h"

namespace dbr {
namespace {

constexpr int kRows = 6;

// Layouts with every column that a discrete space has, and a continuous one.
constexpr TransitionLayout kDiscrete{
    .observation_width = 5, .action_width = 1, .mask_width = 3, .return_width = 1};
constexpr TransitionLayout kContinuous{
    .observation_width = 5, .action_width = 2, .mask_width = 0, .return_width = 1};

// Float k of a column in transition `row`. No two are alike, except that a discrete action must be a legal
// one.
float Value(const TransitionLayout& layout, const ColumnPlace& place, int row, int k) {
  if (place.offset == layout.action_offset() && layout.mask_width > 0)
    return static_cast<float>(row % layout.mask_width);
  return static_cast<float>(1 + row * layout.stride() + place.offset + k);
}

// A message of kRows transitions with the floats of Value.
InsertRequest Message(const TransitionLayout& layout) {
  InsertRequest message;
  message.set_first_sequence(1);
  SetLayout(layout, message.mutable_transitions());
  for (int row = 0; row < kRows; ++row) {
    ColumnSet<std::vector<float>> floats;
    TransitionView transition;
    ForEachColumn(
        [&layout, row](const ColumnPlace& place, std::vector<float>& column, auto* value) {
          for (int k = 0; k < place.width; ++k) column.push_back(Value(layout, place, row, k));
          SetValue(column.data(), place.width, value);
        },
        layout.columns(), floats, ValuesOf(&transition));
    AppendTransition(transition, kUnjudged, 0, message.mutable_transitions());
  }
  return message;
}

std::unique_ptr<PartitionedBuffer> BufferWith(const InsertRequest& message, const TransitionLayout& layout) {
  StoreOptions options;
  options.env = "test";
  options.layout = layout;
  options.capacity = kRows;
  auto store = TransitionStore::Open(options);
  EXPECT_TRUE(store.ok()) << store.status();
  auto buffer = PartitionedBuffer::Make(std::move(*store), {});
  EXPECT_TRUE(buffer.ok()) << buffer.status();
  std::vector<RowEnd> ends;
  auto batch = DecodeInsert(message, layout, &ends);
  EXPECT_TRUE(batch.ok()) << batch.status();
  const auto place = (*buffer)->OpenWriter({.id = 1, .name = "actor-0"});
  EXPECT_TRUE((*buffer)->Insert(*place, &*batch, absl::InfinitePast()).ok());
  return std::move(*buffer);
}

class EveryColumn : public testing::TestWithParam<TransitionLayout> {};

TEST_P(EveryColumn, ComesBackAsItWasWritten) {
  const TransitionLayout& layout = GetParam();
  const auto buffer = BufferWith(Message(layout), layout);
  const DrawRequest request{.counts = {100, 0, 0}, .allow_empty_partitions = true};
  SampleReply reply;
  DrawResult result;
  ASSERT_TRUE(buffer->Draw(request, MakeRoom(request, layout, &reply), absl::InfinitePast(), &result).ok());
  Encode(result, layout, &reply);
  Batch batch;
  ASSERT_TRUE(Decode(reply.uniform().transitions(), layout, &batch).ok());
  ASSERT_EQ(batch.size(), 100);
  std::set<std::uint64_t> rows;
  for (int i = 0; i < 100; ++i) {
    const std::uint64_t key = reply.uniform().keys(i);
    rows.insert(key);
    const auto expect = [&layout, i, key](const ColumnPlace& place, const auto& column) {
      ASSERT_EQ(column.size(), 100 * place.width) << place.name;
      for (int k = 0; k < place.width; ++k) {
        EXPECT_EQ(column.data()[i * place.width + k], Value(layout, place, static_cast<int>(key) - 1, k))
            << place.name;
      }
    };
    ForEachColumn(expect, layout.columns(), batch);
  }
  EXPECT_EQ(rows.size(), static_cast<std::size_t>(kRows));
}

TEST_P(EveryColumn, IsRefusedWhereAValueIsNotFinite) {
  const TransitionLayout& layout = GetParam();
  ForEachColumn(
      [&layout](const ColumnPlace& place) {
        InsertRequest message = Message(layout);
        const auto spoil = [&place](const ColumnPlace& here, auto* column) {
          if (std::string(here.name) == place.name && here.width > 0) column->Set(here.width, kUnjudged);
        };
        ForEachColumn(spoil, layout.columns(), ColumnsIn(message.mutable_transitions()));
        const auto buffer = BufferWith(message, layout);
        EXPECT_EQ(buffer->Stats().counters.refused, place.width > 0 ? 1u : 0u) << place.name;
      },
      layout.columns());
}

INSTANTIATE_TEST_SUITE_P(Layouts, EveryColumn, testing::Values(kDiscrete, kContinuous), [](const auto& info) {
  return info.param.mask_width > 0 ? "Discrete" : "Continuous";
});

// A field of the message that is no column would be sent and lost.
TEST(ColumnsTest, AreTheFloatsOfTheMessageBesideTheAdvantages) {
  std::set<std::string> columns{"advantages"}, fields;
  ForEachColumn([&columns](const ColumnPlace& place) { columns.insert(place.name); }, kDiscrete.columns());
  const auto& descriptor = *TransitionBatch::descriptor();
  for (int i = 0; i < descriptor.field_count(); ++i) {
    const auto& field = *descriptor.field(i);
    if (field.is_repeated() && field.cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_FLOAT)
      fields.insert(field.name());
  }
  EXPECT_EQ(columns, fields);
}

TEST(ColumnsTest, LieInARowWithoutGaps) {
  int offset = 0;
  ForEachColumn(
      [&offset](const ColumnPlace& place) {
        EXPECT_EQ(place.offset, offset) << place.name;
        offset += place.width;
      },
      kDiscrete.columns());
  EXPECT_EQ(offset, kDiscrete.stride());
  EXPECT_EQ(offset, 5 + 1 + 3 + 1 + 1 + 1 + 5 + 3);
}

}  // namespace
}  // namespace dbr
