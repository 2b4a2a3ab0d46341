// Which rows lie in D, D+ (advantage >= 0), D- (advantage <= 0) or are not yet judged, and how each is drawn
// from.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "replay/buffer/selectors/selector.h"
#include "replay/store/writer_table.h"

namespace dbr {

// The parts of a draw come first.
enum Part { kUniform = 0, kPlus = 1, kMinus = 2, kUnjudgedPart = 3 };
inline constexpr int kDrawnParts = 3;
inline constexpr int kAllParts = 4;

// One selector for each part; every operation is as cheap as the selector's. Thread-compatible: the buffer's
// lock guards it.
class Partitions {
 public:
  // InvalidArgument for an unknown selector.
  static absl::StatusOr<Partitions> Make(absl::string_view selector, std::uint32_t capacity);

  // A row with its advantage (NaN: not yet judged) enters, leaves, or has its advantage changed from
  // `old_advantage`.
  void Add(std::uint32_t slot, float advantage, Source source) {
    selectors_[kUniform]->Insert(slot);
    Join(slot, advantage, source);
    seed_[kUniform] += source == Source::kSeed;
  }
  void Remove(std::uint32_t slot, float advantage, Source source) {
    selectors_[kUniform]->Remove(slot);
    Leave(slot, advantage, source);
    seed_[kUniform] -= source == Source::kSeed;
  }
  void Relabel(std::uint32_t slot, float old_advantage, float advantage, Source source) {
    if (Code(old_advantage) == Code(advantage)) return;
    Leave(slot, old_advantage, source);
    Join(slot, advantage, source);
  }

  const Selector& operator[](int part) const { return *selectors_[part]; }
  std::uint32_t size(int part) const { return selectors_[part]->size(); }
  std::uint64_t seed(int part) const { return seed_[part]; }  // rows of source seed

 private:
  using Selectors = std::array<std::unique_ptr<Selector>, kAllParts>;
  explicit Partitions(Selectors selectors) : selectors_(std::move(selectors)) {}

  // The parts beside D that an advantage belongs to, as bits.
  static unsigned Code(float advantage) {
    if (std::isnan(advantage)) return 1u << kUnjudgedPart;
    return (advantage >= 0 ? 1u << kPlus : 0) | (advantage <= 0 ? 1u << kMinus : 0);
  }
  void Join(std::uint32_t slot, float advantage, Source source) {
    for (int part = kPlus; part < kAllParts; ++part) {
      if ((Code(advantage) >> part & 1) == 0) continue;
      selectors_[part]->Insert(slot);
      seed_[part] += source == Source::kSeed;
    }
  }
  void Leave(std::uint32_t slot, float advantage, Source source) {
    for (int part = kPlus; part < kAllParts; ++part) {
      if ((Code(advantage) >> part & 1) == 0) continue;
      selectors_[part]->Remove(slot);
      seed_[part] -= source == Source::kSeed;
    }
  }

  Selectors selectors_;
  std::array<std::uint64_t, kAllParts> seed_{};
};

}  // namespace dbr
