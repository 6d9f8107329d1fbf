#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "understory/util/random.h"

namespace understory {

// A stream of random numbers that depends on nothing but its key: the noise of a beam is the same
// whichever thread casts it and in whatever order. Cheap to make, a value type.
class CounterNoise {
 public:
  CounterNoise(std::uint64_t seed, std::uint64_t a, std::uint64_t b)
      : state_(hash_numbers(seed, a, b)) {}

  // In [0, 1), 24 bits.
  float uniform() { return static_cast<float>(next() >> 40) * 0x1.0p-24F; }
  // Mean 0, standard deviation 1 (Box-Muller).
  float normal() {
    const float u = 1.0F - uniform();
    const float v = uniform();
    return std::sqrt(-2.0F * std::log(u)) * std::cos(2.0F * std::numbers::pi_v<float> * v);
  }
  // Two independent normal numbers for the price of one.
  struct Pair {
    float first;
    float second;
  };
  Pair normal_pair() {
    const std::uint64_t bits = next();
    const float u = 1.0F - static_cast<float>(bits >> 40) * 0x1.0p-24F;
    const float v = static_cast<float>(bits & 0xffffffU) * 0x1.0p-24F;
    const float radius = std::sqrt(-2.0F * std::log(u));
    const float angle = 2.0F * std::numbers::pi_v<float> * v;
    return {radius * std::cos(angle), radius * std::sin(angle)};
  }

 private:
  std::uint64_t next() {
    state_ += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }

  std::uint64_t state_;
};

// Number streams of one seed, one per purpose, so that a change in one leaves the others alone.
enum class NoiseStream : std::uint64_t {
  kTerrain = 1,
  kRoute,
  kStand,
  kShapes,
  kUndergrowth,
  kCarrier,
  kLidar,
  kImu,
  kGnss,
  kBoom,
  kMag,
  kWeather,
  kTotalStation,
};

[[nodiscard]] inline std::uint64_t stream_of(NoiseStream stream) {
  return static_cast<std::uint64_t>(stream);
}

}  // namespace understory
