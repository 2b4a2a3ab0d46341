// What every selector must do, and what the uniform one adds.
#include "replay/buffer/selectors/selector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "core/rng.h"

namespace dbr {
namespace {

class SelectorConformance : public ::testing::TestWithParam<std::string> {
 protected:
  static constexpr std::uint32_t kCapacity = 64;

  void SetUp() override {
    auto made = MakeSelector(GetParam(), kCapacity);
    ASSERT_TRUE(made.ok()) << made.status();
    selector_ = std::move(*made);
  }

  std::unique_ptr<Selector> selector_;
};

TEST_P(SelectorConformance, BeginsEmpty) {
  EXPECT_EQ(selector_->size(), 0u);
  EXPECT_FALSE(selector_->Contains(0));
}

TEST_P(SelectorConformance, KeepsTheSetThatAModelKeeps) {
  Rng rng(7);
  std::set<std::uint32_t> model;
  for (int step = 0; step < 20000; ++step) {
    const std::uint32_t slot = rng.Below(kCapacity);
    if (model.erase(slot) > 0) {
      selector_->Remove(slot);
    } else {
      selector_->Insert(slot);
      model.insert(slot);
    }
    ASSERT_EQ(selector_->size(), model.size());
    ASSERT_EQ(selector_->Contains(slot), model.count(slot) > 0);
    if (model.empty()) continue;
    ASSERT_TRUE(model.count(selector_->Draw(&rng)) > 0);
  }
  for (std::uint32_t slot = 0; slot < kCapacity; ++slot)
    EXPECT_EQ(selector_->Contains(slot), model.count(slot) > 0);
}

TEST_P(SelectorConformance, DrawsEveryMember) {
  Rng rng(8);
  for (std::uint32_t slot = 0; slot < kCapacity; slot += 3) selector_->Insert(slot);
  std::set<std::uint32_t> drawn;
  for (int i = 0; i < 10000; ++i) drawn.insert(selector_->Draw(&rng));
  EXPECT_EQ(drawn.size(), selector_->size());
}

std::vector<std::string> Names() {
  const auto names = SelectorNames();
  return {names.begin(), names.end()};
}
INSTANTIATE_TEST_SUITE_P(All, SelectorConformance, ::testing::ValuesIn(Names()),
                         [](const auto& info) { return info.param; });

TEST(UniformSelector, DrawsEachMemberAsOften) {
  auto selector = *MakeSelector("uniform", 100);
  Rng rng(9);
  for (std::uint32_t slot = 0; slot < 100; ++slot) selector->Insert(slot);
  for (std::uint32_t slot = 0; slot < 90; ++slot) selector->Remove(slot);
  constexpr int kDraws = 100000;
  std::vector<int> counts(100);
  for (int i = 0; i < kDraws; ++i) ++counts[selector->Draw(&rng)];
  double chi_square = 0;  // 9 degrees of freedom; 33.7 has a probability of 1e-4
  for (std::uint32_t slot = 90; slot < 100; ++slot) {
    const double off = counts[slot] - kDraws / 10.0;
    chi_square += off * off / (kDraws / 10.0);
  }
  EXPECT_LT(chi_square, 33.7);
}

TEST(MakeSelector, NamesThoseThatThereAre) {
  const auto made = MakeSelector("unifrom", 10);
  EXPECT_EQ(made.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(made.status().ToString(), ::testing::HasSubstr("expected one of uniform, found 'unifrom'"));
}

}  // namespace
}  // namespace dbr
