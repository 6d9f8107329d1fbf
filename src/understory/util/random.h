#pragma once

#include <array>
#include <cstdint>

namespace understory {

// xoshiro256++ generator with its own distributions, so that a seed gives the same numbers with
// every compiler and standard library. Not for cryptography. Not thread-safe: one per task, made by
// `Random(seed, stream)` with a stream number of its own.
class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0);

  std::uint64_t next();
  double uniform();                         // in [0, 1)
  double uniform(double low, double high);  // in [low, high)
  double normal();                          // mean 0, standard deviation 1
  double normal(double mean, double sd) { return mean + sd * normal(); }
  double exponential(double mean);
  std::uint64_t below(std::uint64_t n);  // in [0, n), n > 0
  bool chance(double probability) { return uniform() < probability; }

 private:
  std::array<std::uint64_t, 4> state_;
};

// A well-mixed 64-bit hash of three numbers: a random number that depends on nothing but its key
// (counter-based). It is for noise that must not depend on the order of work.
[[nodiscard]] std::uint64_t hash_numbers(std::uint64_t a, std::uint64_t b = 0, std::uint64_t c = 0);

}  // namespace understory
