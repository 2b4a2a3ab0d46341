// Every slot of the set with the same probability.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "replay/buffer/selectors/selector.h"

namespace dbr {

// The members stand without gaps in one array, and each slot knows its place there; removing moves the last
// one into the hole. 8 bytes a slot. Thread-compatible.
class UniformSelector final : public Selector {
 public:
  explicit UniformSelector(std::uint32_t capacity);

  void Insert(std::uint32_t slot) override;
  void Remove(std::uint32_t slot) override;
  bool Contains(std::uint32_t slot) const override;
  std::uint32_t size() const override { return static_cast<std::uint32_t>(members_.size()); }
  std::uint32_t Draw(Rng* rng) const override { return members_[rng->Below(size())]; }

 private:
  std::vector<std::uint32_t> members_;
  std::vector<std::uint32_t> places_;  // of each slot in members_, or kAbsent
};

std::unique_ptr<Selector> MakeUniformSelector(std::uint32_t capacity);

}  // namespace dbr
