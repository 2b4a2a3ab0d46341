#include "replay/client/outbox.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/replay/rows.h"

namespace dbr {
namespace {

class OutboxTest : public ::testing::Test {
 protected:
  static constexpr absl::Duration kAge = absl::Milliseconds(100);

  // Appends the next `count` transitions at now_.
  void Append(int count) {
    const Rows rows(kSmallLayout, outbox_.appended() + 1, count);
    for (int i = 0; i < count; ++i) {
      outbox_.Append(rows.columns().Row(kSmallLayout, i), 1.0f, 1, std::nullopt, now_);
    }
  }
  InsertReply Reply(std::uint64_t acknowledged) {
    InsertReply reply;
    reply.set_acknowledged_sequence(acknowledged);
    return reply;
  }
  // All messages that Next gives now.
  std::vector<InsertRequest> SendAll(bool waited_for = false) {
    std::vector<InsertRequest> sent;
    while (const InsertRequest* message = outbox_.Next(now_, waited_for)) {
      sent.push_back(*message);
      outbox_.GiveBack();
    }
    return sent;
  }

  absl::Time now_ = absl::FromUnixSeconds(1);
  Outbox outbox_{{.layout = kSmallLayout, .rows_per_message = 10, .window = 8, .max_batch_age = kAge}};
};

TEST_F(OutboxTest, SendsFullMessagesAtOnceAndInOrder) {
  Append(35);
  const auto sent = SendAll();
  ASSERT_EQ(sent.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(sent[i].first_sequence(), 10 * i + 1);
    EXPECT_EQ(sent[i].transitions().count(), 10u);
    EXPECT_EQ(sent[i].transitions().rewards(9), Rows::Value(10 * i + 10));
  }
}

TEST_F(OutboxTest, SendsAMessageThatIsNotFullWhenItIsOld) {
  Append(3);
  EXPECT_EQ(outbox_.NextTime(false), now_ + kAge);
  EXPECT_TRUE(outbox_.Next(now_, false) == nullptr);
  now_ += kAge;
  const InsertRequest* message = outbox_.Next(now_, false);
  ASSERT_TRUE(message != nullptr);
  EXPECT_EQ(message->transitions().count(), 3u);
  EXPECT_TRUE(message->acknowledge());
  EXPECT_EQ(outbox_.NextTime(false), absl::InfiniteFuture());
}

TEST_F(OutboxTest, SendsAMessageThatIsNotFullWhenItIsWaitedFor) {
  EXPECT_EQ(outbox_.NextTime(true), absl::InfiniteFuture());  // nothing to send
  Append(3);
  EXPECT_EQ(outbox_.NextTime(true), absl::InfinitePast());
  EXPECT_EQ(SendAll(true).size(), 1u);
}

TEST_F(OutboxTest, NeverHasMoreThanTheWindowUnderWay) {
  Append(200);
  EXPECT_EQ(SendAll().size(), 8u);
  EXPECT_EQ(outbox_.NextTime(true), absl::InfiniteFuture());
  outbox_.Acknowledge(Reply(25));  // two whole messages, and half of one
  EXPECT_EQ(outbox_.acknowledged(), 25u);
  const auto sent = SendAll();
  ASSERT_EQ(sent.size(), 2u);
  EXPECT_EQ(sent[0].first_sequence(), 81u);
}

TEST_F(OutboxTest, AFullWindowAlwaysHasAnAcknowledgementUnderWay) {
  for (const std::size_t window : {1, 2, 3, 4, 7, 16}) {
    Outbox outbox({.layout = kSmallLayout, .rows_per_message = 1, .window = window, .max_batch_age = kAge});
    const Rows rows(kSmallLayout, 1, 100);
    for (int i = 0; i < 100; ++i)
      outbox.Append(rows.columns().Row(kSmallLayout, i), 1, 1, std::nullopt, now_);
    // A server that answers exactly when it is asked takes all.
    while (outbox.acknowledged() < 100) {
      std::uint64_t asked = 0;
      while (const InsertRequest* message = outbox.Next(now_, true)) {
        outbox.GiveBack();  // it stays as it is until something is acknowledged
        if (message->has_transitions()) asked = message->acknowledge() ? message->first_sequence() : asked;
        if (!message->has_transitions()) asked = 100;
      }
      ASSERT_GT(asked, outbox.acknowledged()) << "window " << window;
      outbox.Acknowledge(Reply(asked));
    }
  }
}

TEST_F(OutboxTest, AsksForTheLastAcknowledgementAfterAWhile) {
  Append(10);
  ASSERT_EQ(SendAll().size(), 1u);  // full, and so without a question
  EXPECT_EQ(outbox_.NextTime(false), now_ + kAge);
  now_ += kAge;
  const InsertRequest* question = outbox_.Next(now_, false);
  ASSERT_TRUE(question != nullptr);
  EXPECT_TRUE(question->acknowledge());
  EXPECT_FALSE(question->has_transitions());
  EXPECT_EQ(outbox_.NextTime(true), absl::InfiniteFuture());  // asked once
}

TEST_F(OutboxTest, SendsAgainWhatIsNotAcknowledged) {
  Append(45);
  ASSERT_EQ(SendAll(true).size(), 5u);
  outbox_.Acknowledge(Reply(20));
  outbox_.Restart();
  outbox_.Acknowledge(Reply(30));  // the opening of the new stream tells of more
  const auto sent = SendAll(true);
  ASSERT_EQ(sent.size(), 2u);
  EXPECT_EQ(sent[0].first_sequence(), 31u);
  EXPECT_EQ(sent[1].first_sequence(), 41u);
  EXPECT_EQ(sent[1].transitions().count(), 5u);
}

TEST_F(OutboxTest, TakesNoAcknowledgementOfWhatItNeverHad) {
  Append(15);
  SendAll();
  outbox_.Acknowledge(Reply(1000000));
  EXPECT_EQ(outbox_.acknowledged(), 15u);
  outbox_.Acknowledge(Reply(3));  // and none is taken back
  EXPECT_EQ(outbox_.acknowledged(), 15u);
}

TEST_F(OutboxTest, AMessageThatIsLentStaysAsItIsUntilItIsGivenBack) {
  Append(20);
  const InsertRequest* lent = outbox_.Next(now_, false);
  outbox_.Acknowledge(Reply(10));  // before the call that sends it has returned
  Append(40);
  EXPECT_EQ(lent->first_sequence(), 1u);
  EXPECT_EQ(lent->transitions().count(), 10u);
  EXPECT_EQ(lent->transitions().rewards(0), Rows::Value(1));
  outbox_.GiveBack();
  EXPECT_EQ(SendAll()[0].first_sequence(), 11u);
  Append(10);  // into the memory of the first one
  outbox_.Acknowledge(Reply(60));
  const InsertRequest* reused = outbox_.Next(now_, false);
  EXPECT_EQ(reused, lent);
  EXPECT_EQ(reused->first_sequence(), 61u);
}

TEST_F(OutboxTest, AMessageThatIsLentAndNotAcknowledgedIsSentAgain) {
  Append(10);
  ASSERT_NE(outbox_.Next(now_, false), nullptr);
  outbox_.GiveBack();  // the stream broke
  outbox_.Restart();
  Append(10);
  const auto sent = SendAll();
  ASSERT_EQ(sent.size(), 2u);
  EXPECT_EQ(sent[0].first_sequence(), 1u);
  EXPECT_EQ(sent[0].transitions().rewards(0), Rows::Value(1));
  EXPECT_EQ(sent[1].first_sequence(), 11u);
}

}  // namespace
}  // namespace dbr
