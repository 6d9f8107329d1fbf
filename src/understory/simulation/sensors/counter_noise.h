#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

#include <Eigen/Core>

#include "understory/util/random.h"

namespace understory {

// A stream of random numbers that depends on nothing but its key. The noise of a beam is the same
// in any thread and order. Cheap to make, a value type.
class CounterNoise {
 public:
  CounterNoise() = default;
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
  // Two independent normal numbers for the price of one (Box-Muller by polynomials, errors below
  // 1e-6): a loop over many streams works through several at once.
  struct Pair {
    float first;
    float second;
  };
  Pair normal_pair() { return normal_pair_of(next()); }
  // The pair that 64 random bits stand for.
  static Pair normal_pair_of(std::uint64_t bits) {
    return normal_pair_of(static_cast<std::uint32_t>(bits >> 40),
                          static_cast<std::uint32_t>(bits & 0xffffffU));
  }
  // From 24 random bits each.
  static Pair normal_pair_of(std::uint32_t far, std::uint32_t around) {
    const float u = 1.0F - static_cast<float>(static_cast<std::int32_t>(far)) * 0x1.0p-24F;
    const float radius = std::sqrt(-2.0F * log_of(u));
    // Eighths of a turn to the nearest quarter, and the rest by series.
    const float quarters = static_cast<float>(static_cast<std::int32_t>(around)) * 0x1.0p-22F;
    const auto whole = static_cast<std::int32_t>((around + (1U << 21)) >> 22);
    const float x = 0.5F * std::numbers::pi_v<float> * (quarters - static_cast<float>(whole));
    const float xx = x * x;
    const float sine =
        x * (1.0F - xx * (1.0F / 6.0F - xx * (1.0F / 120.0F - xx * (1.0F / 5040.0F))));
    const float cosine =
        1.0F - xx * (0.5F - xx * (1.0F / 24.0F - xx * (1.0F / 720.0F - xx * (1.0F / 40320.0F))));
    const bool odd = (whole & 1) != 0;
    const float along = odd ? sine : cosine;
    const float up = odd ? cosine : sine;
    return {radius * (((whole + 1) & 2) != 0 ? -along : along),
            radius * ((whole & 2) != 0 ? -up : up)};
  }

  // 64 random bits.
  std::uint64_t next() {
    state_ += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }

 private:
  friend class NoiseRow;
  explicit CounterNoise(std::uint64_t state) : state_(state) {}

  // Natural logarithm of a number in (0, 1].
  static float log_of(float u) {
    const auto bits = std::bit_cast<std::int32_t>(u);
    const std::int32_t exponent = (bits - 0x3f3504f3) >> 23;  // to a mantissa in [0.71, 1.41)
    const auto mantissa = std::bit_cast<float>(bits - (exponent << 23));
    const float t = (mantissa - 1.0F) / (mantissa + 1.0F);
    const float tt = t * t;
    const float series =
        2.0F * t *
        (1.0F + tt * (1.0F / 3.0F + tt * (1.0F / 5.0F + tt * (1.0F / 7.0F + tt / 9.0F))));
    return std::min(0.0F, static_cast<float>(exponent) * std::numbers::ln2_v<float> + series);
  }

  std::uint64_t state_ = 0;
};

// The streams (seed, a, 0), (seed, a, 1), ... of one purpose, each of them cheaper to make than a
// CounterNoise by itself.
class NoiseRow {
 public:
  NoiseRow(std::uint64_t seed, std::uint64_t a) : base_(hash_numbers(seed, a)) {}
  [[nodiscard]] CounterNoise at(std::uint64_t b) const {
    return CounterNoise(base_ + b * 0xd1342543de82ef95ULL);
  }

 private:
  std::uint64_t base_;
};

// Three independent normal numbers of standard deviation one.
[[nodiscard]] inline Eigen::Vector3d normal3(CounterNoise& noise) {
  const double x = noise.normal();
  const double y = noise.normal();
  const double z = noise.normal();
  return {x, y, z};
}

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
  kHeadLog,
  kDrawnSite,
  kObjects,
  kFollowers,
};

// The number of a stream, for seeds.
[[nodiscard]] inline std::uint64_t stream_of(NoiseStream stream) {
  return static_cast<std::uint64_t>(stream);
}

}  // namespace understory
