#include "understory/simulation/scene/stem_surface.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/simulation/sensors/counter_noise.h"

namespace understory {
namespace {

constexpr float kDbhHeight = 1.3F;
constexpr float kPlateWidth = 0.035F;  // metres around the stem
constexpr float kPlateHeight = 0.11F;
constexpr float kHalfSwelling = 0.06F;  // metres along the stem

// How deep the bark's relief is at the foot and above, and how much the branches' bases swell. Both
// are shares of the site's figures, which are for a pine of 25 cm.
struct Bark {
  float low;
  float high;
  float swelling;
};

Bark bark_of(Species species) {
  switch (species) {
    case Species::kPine:
      return {1.0F, 0.25F, 1.0F};  // thick plates below, flakes above
    case Species::kSpruce:
      return {0.4F, 0.3F, 0.6F};
    case Species::kBirch:
      return {0.35F, 0.08F, 0.0F};
  }
  return {};
}

float random_at(std::uint32_t key, std::int32_t column, std::int32_t row) {
  std::uint32_t x = key + static_cast<std::uint32_t>(column) * 0x9e3779b1U +
                    static_cast<std::uint32_t>(row) * 0x85ebca77U;
  x = (x ^ (x >> 16)) * 0x7feb352dU;
  x = (x ^ (x >> 15)) * 0x846ca68bU;
  return static_cast<float>(x >> 8) * 0x1p-23F - 1.0F;
}

// Random numbers on a grid, between them straight lines; `columns` close a ring. Standard deviation
// near 0.39.
float grid_noise(std::uint32_t key, float column, std::int32_t columns, float row) {
  const float left = std::floor(column);
  const float low = std::floor(row);
  const float u = column - left;
  const float v = row - low;
  const std::int32_t i = static_cast<std::int32_t>(left) % columns;
  const std::int32_t k = i + 1 == columns ? 0 : i + 1;
  const auto j = static_cast<std::int32_t>(low);
  const float below = random_at(key, i, j) * (1.0F - u) + random_at(key, k, j) * u;
  const float above = random_at(key, i, j + 1) * (1.0F - u) + random_at(key, k, j + 1) * u;
  return below * (1.0F - v) + above * v;
}

}  // namespace

StemSurface::StemSurface(const StandConfig& config, const GrownTree& tree, std::uint64_t seed) {
  if (!tree.cloud.empty()) return;  // as it was scanned
  const Bark bark = bark_of(tree.species);
  CounterNoise noise(hash_numbers(seed, stream_of(NoiseStream::kShapes), 101),
                     static_cast<std::uint64_t>(tree.id), 0);
  // (largest - smallest diameter) / mean is twice the second wave. The others look less.
  const float oval = 0.5F * static_cast<float>(config.ovality) * (0.4F + 1.2F * noise.uniform());
  const float sizes[3] = {oval, 0.35F * oval, 0.25F * oval};
  for (int i = 0; i < 3; ++i) {
    const float size = sizes[i];
    const float at = 2.0F * std::numbers::pi_v<float> * noise.uniform();
    const float turn = 0.8F * noise.normal();  // from foot to top
    Wave& wave = waves_[i];
    wave = {size * std::cos(at), size * std::sin(at), 0.0F, 0.0F};
    wave.more_cosine = size * std::cos(at + turn) - wave.cosine;
    wave.more_sine = size * std::sin(at + turn) - wave.sine;
  }
  radius_m_ = static_cast<float>(0.5 * tree.dbh_m);
  height_m_ = static_cast<float>(tree.height_m);
  crown_base_m_ = static_cast<float>(std::max(0.5, tree.crown_base_m));
  whorl_m_ = tree.species == Species::kPine ? 0.42F : 0.3F;
  const float size = std::min(1.5F, static_cast<float>(tree.dbh_m) / 0.25F);
  swelling_m_ = static_cast<float>(config.whorl_swelling_m) * bark.swelling * size;
  relief_low_m_ = static_cast<float>(config.bark_relief_m) * bark.low * size;
  relief_high_m_ = static_cast<float>(config.bark_relief_m) * bark.high * size;
  plates_ = std::max(
      4, static_cast<std::int32_t>(2.0F * std::numbers::pi_v<float> * radius_m_ / kPlateWidth));
  key_ = static_cast<std::uint32_t>(noise.next());
  round_ = oval <= 0.0F && swelling_m_ <= 0.0F && relief_low_m_ <= 0.0F;
}

float StemSurface::bark(float x, float y, float height_m) const {
  // Full relief on the lowest metres, fading over the next.
  const float low = std::clamp(1.0F - (height_m - 2.0F) / 4.0F, 0.0F, 1.0F);
  const float relief = relief_high_m_ + low * (relief_low_m_ - relief_high_m_);
  // Around the stem by quarters, without an arc tangent: plates differ in width by a quarter.
  const float side = y / (std::abs(x) + std::abs(y));
  const float quarters = x >= 0.0F ? 1.0F + side : 3.0F - side;  // 0..4
  const auto plates = static_cast<float>(plates_);
  const float column = std::min(0.25F * quarters, 0.99999F) * plates;
  const float row = (height_m + 2.0F) / kPlateHeight;
  const float plate = grid_noise(key_, column, plates_, row);
  const float crack = grid_noise(key_ + 1U, 2.0F * column, 2 * plates_, 2.0F * row);
  return relief * (2.1F * plate + 1.5F * crack);
}

float StemSurface::offset(float x, float y, float height_m) const {
  if (round_) return 0.0F;
  const float up = std::clamp(height_m / height_m_, 0.0F, 1.0F);
  const float radius = radius_m_ * std::min(1.3F, (1.0F - up) / (1.0F - kDbhHeight / height_m_));
  const float c2 = x * x - y * y;
  const float s2 = 2.0F * x * y;
  const float cosines[3] = {c2, x * c2 - y * s2, c2 * c2 - s2 * s2};
  const float sines[3] = {s2, y * c2 + x * s2, 2.0F * c2 * s2};
  float share = 0.0F;
  float longer = 0.0F;  // the girth of a lobed section, for its mean radius
  for (int i = 0; i < 3; ++i) {
    const float cosine = waves_[i].cosine + up * waves_[i].more_cosine;
    const float sine = waves_[i].sine + up * waves_[i].more_sine;
    share += cosine * cosines[i] + sine * sines[i];
    const auto order = static_cast<float>(i + 2);
    longer += 0.25F * order * order * (cosine * cosine + sine * sine);
  }
  // Roots pull the lowest decimetres out.
  const float foot = std::max(0.0F, height_m) / 0.25F;
  const float rooted = 1.0F + 2.0F / (1.0F + foot * foot * foot);
  // Knots heal over below the crown.
  const float phase = height_m / whorl_m_;
  const float from_whorl = whorl_m_ * std::abs(phase - std::floor(phase) - 0.5F);
  const float bump = std::max(0.0F, 1.0F - from_whorl / kHalfSwelling) - kHalfSwelling / whorl_m_;
  const float fresh = std::clamp(height_m / crown_base_m_, 0.15F, 1.0F) * (up < 0.9F ? 1.0F : 0.0F);
  return radius * (share * rooted - longer) + swelling_m_ * fresh * bump + bark(x, y, height_m);
}

float StemSurface::lobe(int order, float height_m) const {
  const Wave& wave = waves_[order - 2];
  const float up = std::clamp(height_m / height_m_, 0.0F, 1.0F);
  return std::hypot(wave.cosine + up * wave.more_cosine, wave.sine + up * wave.more_sine);
}

}  // namespace understory
