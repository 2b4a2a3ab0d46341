// Which rows of a partition a draw takes.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/rng.h"

namespace dbr {

// A set of slots (row numbers of the store, below a capacity given at its making) with a way to draw from it.
// Every operation is O(1), or O(log n) for selectors that rank. Thread-compatible: the buffer's lock guards
// it.
class Selector {
 public:
  virtual ~Selector() = default;

  virtual void Insert(std::uint32_t slot) = 0;  // requires that the slot is not in the set
  virtual void Remove(std::uint32_t slot) = 0;  // requires that the slot is in the set
  virtual bool Contains(std::uint32_t slot) const = 0;
  virtual std::uint32_t size() const = 0;

  // Draws a slot, with replacement. Requires that the set is not empty.
  virtual std::uint32_t Draw(Rng* rng) const = 0;
};

// Makes an empty selector for slots below `capacity`. InvalidArgument, naming those that there are, for
// another name.
absl::StatusOr<std::unique_ptr<Selector>> MakeSelector(absl::string_view name, std::uint32_t capacity);

// All names; the conformance suite walks them.
std::vector<absl::string_view> SelectorNames();

}  // namespace dbr
