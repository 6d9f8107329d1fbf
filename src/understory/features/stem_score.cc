#include "understory/features/stem_score.h"

#include <algorithm>
#include <cmath>

#include "understory/features/features_constants.h"

namespace understory {
namespace {

using namespace features_constants::stem_score;

// Fitted by benchmarks/stem_score.py to the chains of simulated frames (VLP-16 and OS0-128 of four
// sites, seeds 11 to 14) whose truth is known; docs/method/sparse.md.
// clang-format off
// weights begin
constexpr double kBias = -1.409;
constexpr StemTraits kMean = {1.056, 0.3503, 0.2434, 0.09236, 0.009913, 0.03899, 0.3082, 1.166, 1.785, 0.3618, 0.3727, 1.032, 0.8454, 0.5165, -0.05829};
constexpr StemTraits kScale = {0.5577, 0.5071, 0.54, 0.1566, 0.0527, 0.1094, 0.2734, 0.862, 0.9907, 0.9761, 0.5865, 1.197, 0.5792, 0.4922, 0.6759};
constexpr StemTraits kLinear = {1.681, 0.1007, -0.05789, -0.582, -0.1225, -0.04946, 0.1032, -1.147, -0.3319, 1.489, -0.4096, -0.9587, -0.04248, -0.8044, 0.9371};
constexpr StemTraits kSquare = {-0.2661, -0.377, 0.1872, -0.0601, 0.01574, 0.001185, -0.0036, 0.04185, -0.01788, -1.499, 0.07449, -0.2786, -0.0135, 0.444, -0.07753};
constexpr StemTraits kWithFirst = {0, 0.08174, -0.04883, -0.04499, 0.0411, -0.1276, -0.0932, -1.036, 0.03519, 2.424, 0.1078, 0.1597, -0.0941, -0.1285, -0.1592};
constexpr StemTraits kWithLast = {0, -0.5538, 0.1364, 0.1897, -0.02307, -0.03835, -0.1523, 0.02238, -0.1555, -0.1475, 0.1346, 0.07537, 0.1662, 0.4407, 0};
// weights end
// clang-format on

}  // namespace

StemTraits stem_traits(const SectionView& view, const StemChain& chain,
                       const StemChainConfig& config, double lowest_above_ground_m) {
  const auto& sections = view.sections();
  const double n = static_cast<double>(chain.sections.size());
  double returns = 0.0;
  double rough = 0.0;
  double hidden = 0.0;
  double with_3 = 0.0;
  double spacing = 0.0;
  double width = 0.0;
  double squares = 0.0;
  double crowd = 0.0;
  for (const int i : chain.sections) {
    const StemSection& section = sections[static_cast<std::size_t>(i)];
    returns += section.returns;
    with_3 += section.returns >= 3 ? 1.0 : 0.0;
    for (const Side side : {section.left, section.right}) {
      rough += side == Side::kRough ? 0.5 : 0.0;
      hidden += side == Side::kHidden ? 0.5 : 0.0;
    }
    for (const int direction : {-1, 1}) {
      for (int j = i + direction; j >= 0 && j < static_cast<int>(sections.size()); j += direction) {
        const StemSection& other = sections[static_cast<std::size_t>(j)];
        if (other.level != section.level || std::abs(j - i) > kCrowdSections) break;
        const double off = (other.surface - section.surface).squaredNorm();
        crowd += off < kCrowdM2 ? 1.0 : 0.0;
      }
    }
    spacing += section.spacing_m;
    width += section.width_m;
    squares += section.width_m * section.width_m;
  }
  const double mean_width = width / n;
  const double width_sd = std::sqrt(std::max(0.0, squares / n - mean_width * mean_width));
  const OwnRadius own = own_radius(view, chain);
  const double odd = own.radius_m > 0.0 ? std::abs(own.radius_m - config.usual_radius_m) /
                                              std::hypot(own.sd_m, config.radius_spread_m)
                                        : 1.0;
  const auto height_of = [&](int i) { return sections[static_cast<std::size_t>(i)].height_m; };
  const double extent = height_of(chain.sections.back()) - height_of(chain.sections.front());
  return {std::log(n),
          std::log(returns / n),
          std::log(1.0 + with_3),
          chain.passed / (n + chain.passed),
          chain.hits / (n + chain.hits),
          rough / n,
          hidden / n,
          std::min(chain.misfit, kMostSds),
          std::min(chain.line.state.tail<2>().norm() / kLean, kMostSds),
          std::log(kExtentM + std::max(0.0, extent)),
          width_sd / (kWidthM + 0.5 * spacing / n),
          std::log(kLowestM + std::max(0.0, lowest_above_ground_m)),
          std::min(odd, kMostSds),
          std::log(1.0 + crowd / n),
          std::log(kSpacing + spacing / n / (2.0 * config.usual_radius_m))};
}

// Traits are brought to mean 0 and spread 1, and squares let a trait have a best value. How much a
// trait says depends on the number of sections (the first trait). It also depends on how finely a
// stem is sampled (the last).
double stem_score(const StemTraits& traits) {
  StemTraits z{};
  for (std::size_t i = 0; i < z.size(); ++i)
    z[i] = (traits[i] - kMean[i]) / kScale[i];
  double sum = kBias;
  for (std::size_t i = 0; i < z.size(); ++i) {
    sum += z[i] *
           (kLinear[i] + kSquare[i] * z[i] + kWithFirst[i] * z.front() + kWithLast[i] * z.back());
  }
  return 1.0 / (1.0 + std::exp(-sum));
}

}  // namespace understory
