#include "understory/simulation/sensors/beam_echo.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace understory {
namespace {

// std::hypot guards against overflow, which nothing here comes near.
float length_of(float a, float b) {
  return std::sqrt(a * a + b * b);
}

// A beam of one ray.
BeamEcho echo_of(const Hit& hit) {
  BeamEcho echo;
  if (hit.surface == Surface::kNone) return echo;
  echo.energy = hit.reflectivity * std::max(0.08F, hit.cosine);
  echo.range_m = (echo.energy * hit.range_m) / echo.energy;  // as a mean of one
  if (!(echo.energy / (echo.range_m * echo.range_m) > 0.0F)) return {};
  echo.tree = hit.tree;
  echo.surface = hit.surface;
  echo.cosine = hit.cosine;
  return echo;
}

// Beams that are cast whole: all hits within a pulse's length, as most beams have them, make one
// echo. Sums in the order of the hits; without any hit, or with farther ones, nothing.
bool echo_of_all(std::span<const Hit> hits, float pulse_m, BeamEcho& echo) {
  float near = std::numeric_limits<float>::infinity();
  float far = 0.0F;
  float sum = 0.0F;
  float strongest_piece = 0.0F;
  const Hit* strongest = nullptr;
  for (const Hit& hit : hits) {
    if (hit.surface == Surface::kNone) continue;
    near = std::min(near, hit.range_m);
    far = std::max(far, hit.range_m);
    const float energy = hit.reflectivity * std::max(0.08F, hit.cosine);
    echo.energy += energy;
    sum += energy * hit.range_m;
    if (energy <= strongest_piece) continue;
    strongest_piece = energy;
    strongest = &hit;
  }
  if (strongest == nullptr || !(far - near <= pulse_m)) return false;
  echo.range_m = sum / echo.energy;
  echo.energy /= static_cast<float>(hits.size());
  echo.tree = strongest->tree;
  echo.surface = strongest->surface;
  echo.cosine = strongest->cosine;
  return echo.energy / (echo.range_m * echo.range_m) > 0.0F;
}

// What one ray of a beam brings back.
struct Piece {
  float range_m;
  float energy;
  const Hit* hit;
};

constexpr std::size_t kMostPieces = 64;  // rays of a beam

// The rays of a beam that met something, by range. Returns how many.
std::size_t pieces_of(std::span<const Hit> hits, Piece (&pieces)[kMostPieces]) {
  const std::size_t count = hits.size();
  std::size_t used = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (hits[k].surface == Surface::kNone) continue;
    const float energy = hits[k].reflectivity * std::max(0.08F, hits[k].cosine);
    pieces[used++] = {hits[k].range_m, energy / static_cast<float>(count), &hits[k]};
  }
  if (used > 1) {
    std::sort(pieces, pieces + used,
              [](const Piece& a, const Piece& b) { return a.range_m < b.range_m; });
  }
  return used;
}

// The strongest of `echoes` that can be told apart from `first`.
void find_second(std::span<const BeamEcho> echoes, const BeamEcho& first, double pulse_m,
                 BeamEcho& second) {
  float second_signal = 0.0F;
  for (const BeamEcho& echo : echoes) {
    const float signal = echo.energy / (echo.range_m * echo.range_m);
    // What lies nearer to the first than a pulse cannot be told apart from it.
    if (std::abs(echo.range_m - first.range_m) < pulse_m || signal <= second_signal) continue;
    second_signal = signal;
    second = echo;
  }
}

}  // namespace

BeamEcho strongest_echo(std::span<const Hit> hits, double pulse_m, BeamEcho* second) {
  if (hits.size() == 1) return echo_of(hits[0]);
  BeamEcho whole;
  if (hits.size() >= kBundleRays && echo_of_all(hits, static_cast<float>(pulse_m), whole))
    return whole;
  Piece pieces[kMostPieces];
  const std::size_t used = pieces_of(hits, pieces);
  BeamEcho best;
  float best_signal = 0.0F;
  BeamEcho echoes[kMostPieces];
  std::size_t echo_count = 0;
  for (std::size_t k = 0; k < used;) {
    BeamEcho echo;
    float strongest_piece = 0.0F;
    float sum = 0.0F;
    std::size_t last = k;
    while (last < used && pieces[last].range_m - pieces[k].range_m <= pulse_m) {
      const Piece& piece = pieces[last];
      echo.energy += piece.energy;
      sum += piece.energy * piece.range_m;
      if (piece.energy > strongest_piece) {
        strongest_piece = piece.energy;
        echo.tree = piece.hit->tree;
        echo.surface = piece.hit->surface;
        echo.cosine = piece.hit->cosine;
      }
      ++last;
    }
    echo.range_m = sum / echo.energy;
    const float signal = echo.energy / (echo.range_m * echo.range_m);
    if (signal > best_signal) {
      best_signal = signal;
      best = echo;
    }
    echoes[echo_count++] = echo;
    k = last;
  }
  if (second != nullptr) find_second({echoes, echo_count}, best, pulse_m, *second);
  return best;
}

BeamReading read_echo(const BeamEcho& echo, const LidarConfig& config, CounterNoise noise) {
  // Whether the echo rises above the noise (half of them do at the threshold) and is not lost.
  const auto threshold = static_cast<float>(config.range_10_percent_m);
  const float signal = 10.0F * echo.energy * threshold * threshold / (echo.range_m * echo.range_m);
  const float steep = signal * signal * signal;
  const float kept = 1.0F - static_cast<float>(config.dropout);
  if (noise.uniform() * (1.0F + steep) > kept * steep) return {};

  const float cosine = std::max(0.1F, echo.cosine);
  const float tangent = std::sqrt(1.0F - cosine * cosine) / cosine;
  float sd = length_of(static_cast<float>(config.range_sd_m),
                       static_cast<float>(config.range_sd_per_m) * echo.range_m) *
             (1.0F + static_cast<float>(config.incidence_gain) * std::min(tangent, 4.0F));
  if (echo.surface == Surface::kStem || echo.surface == Surface::kDeadWood) {
    sd = length_of(sd, static_cast<float>(config.bark_sd_m));
  }
  const CounterNoise::Pair shiver = noise.normal_pair();
  float range = echo.range_m + sd * shiver.first;
  if (config.range_step_m > 0.0) {
    const auto step = static_cast<float>(config.range_step_m);
    range = std::nearbyint(range / step) * step;
  }
  if (range < config.min_range_m || range > config.max_range_m) return {};
  const float brightness = 255.0F * echo.energy * (1.0F + 0.06F * shiver.second);
  return {range, std::nearbyint(std::clamp(brightness, 0.0F, 255.0F))};
}

}  // namespace understory
