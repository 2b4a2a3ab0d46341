// Plays a game to its end by uniformly random moves: the evaluation inside the tree search. It is in a header
// because it is the innermost loop of every search.
#pragma once

#include <bit>
#include <cstdint>

#ifdef __BMI2__
#include <immintrin.h>
#endif

#include "core/rng.h"
#include "envs/connect4/board.h"

namespace dbr::connect4 {

// Returns the set bit of `bits` that has `n` set bits below it. Requires n < popcount(bits). The loop serves
// machines without BMI2.
inline std::uint64_t NthSetBitByLoop(std::uint64_t bits, unsigned n) {
  for (; n > 0; --n) bits &= bits - 1;
  return bits & (~bits + 1);
}
inline std::uint64_t NthSetBit(std::uint64_t bits, unsigned n) {
#ifdef __BMI2__
  return _pdep_u64(std::uint64_t{1} << n, bits);
#else
  return NthSetBitByLoop(bits, n);
#endif
}

// A stream of uniform choices that uses one 64-bit draw for eight of them. The draw is read as a fraction in
// [0, 1). It is multiplied by n: the whole part is the choice, and the rest is the fraction for the next one.
// With n <= 7 the bias of the eighth choice is less than 7^8 / 2^64 < 2^-41. The generator must outlive the
// stream. One thread at a time.
class ChoiceStream {
 public:
  explicit ChoiceStream(Rng& rng) : rng_(rng) {}

  // Returns a uniformly drawn set bit of `bits`, which must have 1 to 7 of them.
  std::uint64_t SetBit(std::uint64_t bits) {
    if (left_ == 0) {
      fraction_ = rng_();
      left_ = 8;
    }
    --left_;
    const auto product =
        static_cast<unsigned __int128>(fraction_) * static_cast<unsigned>(std::popcount(bits));
    fraction_ = static_cast<std::uint64_t>(product);
    return NthSetBit(bits, static_cast<unsigned>(product >> 64));
  }

 private:
  Rng& rng_;
  std::uint64_t fraction_ = 0;
  int left_ = 0;
};

// Plays uniformly random legal moves to the end. Returns 1 if the side to move in `board` wins, -1 if it
// loses, 0 for a draw. Requires a game that is not over.
inline int RandomPlayout(const Board& board, ChoiceStream& choices) {
  Cells mover = board.mover();
  Cells other = board.other();
  // Puts one stone for a side. Only that side can win by it.
  const auto wins = [&choices](Cells& stones, Cells occupied) {
    stones |= choices.SetBit(LandingCells(occupied));
    return HasFour(stones);
  };
  while (true) {
    if (wins(mover, mover | other)) return 1;
    if ((mover | other) == kAllCells) return 0;
    if (wins(other, mover | other)) return -1;
    if ((mover | other) == kAllCells) return 0;
  }
}

}  // namespace dbr::connect4
