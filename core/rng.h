// The random generator of the whole system: xoshiro256++ (Blackman and Vigna 2019), seeded by splitmix64.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace dbr {

// A stream of random numbers. The same seed gives the same stream on every machine; the state can be saved.
// Thread-compatible: one thread at a time.
class Rng {
 public:
  using result_type = std::uint64_t;
  using State = std::array<std::uint64_t, 4>;

  explicit Rng(std::uint64_t seed) {
    for (auto& word : state_) {
      seed += 0x9e3779b97f4a7c15u;
      std::uint64_t z = seed;
      z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
      z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
      word = z ^ (z >> 31);
    }
  }

  static constexpr std::uint64_t min() { return 0; }
  static constexpr std::uint64_t max() { return ~std::uint64_t{0}; }

  std::uint64_t operator()() {
    const std::uint64_t result = Rotate(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = Rotate(state_[3], 45);
    return result;
  }

  // Uniform in [0, n); n > 0. Lemire's multiplication without rejection: biased by less than n / 2^32.
  std::uint32_t Below(std::uint32_t n) {
    return static_cast<std::uint32_t>(((*this)() >> 32) * std::uint64_t{n} >> 32);
  }
  // Uniform in [0, 1).
  double Uniform() { return static_cast<double>((*this)() >> 11) * 0x1.0p-53; }
  // Standard normal, by Box and Muller; takes two numbers of the stream each.
  double Normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform()));
    return radius * std::cos(6.283185307179586477 * Uniform());
  }
  // A generator whose stream is independent of this one's and of other `stream` numbers'.
  Rng Fork(std::uint64_t stream) const {
    return Rng(state_[0] ^ Rotate(stream * 0xd1342543de82ef95u + 1, 29));
  }

  const State& state() const { return state_; }
  void set_state(const State& state) { state_ = state; }

 private:
  static std::uint64_t Rotate(std::uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }

  State state_;
};

}  // namespace dbr
