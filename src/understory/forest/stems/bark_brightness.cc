#include "understory/forest/stems/bark_brightness.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "understory/forest/stem_constants.h"

namespace understory {
namespace {

using namespace stem_constants::bark_brightness;

// A diameter without what the beams add to it, metres.
double true_diameter(const StemLook& look, const BeamFootprint& beam) {
  return 2.0 * (look.radius_m - excess_radius_m(beam, look.radius_m, look.arc_deg));
}

// How pairs differ with one brightness.
struct Difference {
  double error_m = 0.0;  // of the diameter from afar, less that by all points
  double sd_m = 0.0;     // that is stated
  double weight = 0.0;   // less where a stem has several pairs
};

Difference difference_of(const BeamConfig& beams, const StemSeenTwice& pair, double times,
                         int pairs_of_stem) {
  const BeamFootprint near = footprint_at(beams, pair.near.range_m);
  const BeamFootprint far = footprint_at(beams, pair.far.range_m);
  Difference difference;
  difference.error_m = true_diameter(pair.far, brightened(far, times)) -
                       true_diameter(pair.near, brightened(near, times));
  difference.sd_m =
      std::hypot(diameter_sd_m(pair.near.spread_m, pair.near.arc_deg, pair.near.range_m, near),
                 diameter_sd_m(pair.far.spread_m, pair.far.arc_deg, pair.far.range_m, far));
  difference.weight = 1.0 / (pairs_of_stem * difference.sd_m * difference.sd_m);
  return difference;
}

// The middle of the values, which come with their weights.
double weighted_median(std::vector<std::pair<double, double>> values) {
  std::sort(values.begin(), values.end());
  double all = 0.0;
  for (const auto& [value, weight] : values)
    all += weight;
  double passed = 0.0;
  for (const auto& [value, weight] : values) {
    passed += weight;
    if (2.0 * passed >= all) return value;
  }
  return 0.0;
}

// Logarithm of how likely it is that nothing but chance parts near from far.
double log_likelihood(const std::vector<Difference>& differences) {
  std::vector<std::pair<double, double>> values;
  for (const Difference& d : differences)
    values.emplace_back(d.error_m, d.weight);
  const double middle = weighted_median(values);
  values.clear();
  for (const Difference& d : differences)
    values.emplace_back(std::abs(d.error_m - middle) / d.sd_m, d.weight);
  const double scale = std::max(kLeastScale, kSdOverMad * weighted_median(values));
  double sum = 0.0;
  double weights = 0.0;
  double information = 0.0;
  for (const Difference& d : differences) {
    const double off = (d.error_m - middle) / (scale * d.sd_m);
    const double weight = d.weight * (kFreedom + 1.0) / (kFreedom + off * off);
    sum += weight * d.error_m;
    weights += weight;
    information += d.weight;
  }
  // Of the mean under Student's t.
  const double variance = scale * scale * (kFreedom + 3.0) / (kFreedom + 1.0) / information;
  const double mean = sum / weights;
  return -0.5 * mean * mean / (variance + kSharedSd * kSharedSd);
}

// Chances from their logarithms.
void set_chances(std::array<double, BarkBrightness::kSteps> logs, BarkBrightness& bark) {
  const double most = *std::max_element(logs.begin(), logs.end());
  double sum = 0.0;
  for (double& value : logs)
    sum += value = std::exp(value - most);
  for (std::size_t k = 0; k < logs.size(); ++k)
    bark.chances[k] = logs[k] / sum;
}

}  // namespace

std::array<double, BarkBrightness::kSteps> BarkBrightness::multiples() {
  std::array<double, kSteps> multiples{};
  for (std::size_t k = 0; k < kSteps; ++k)
    multiples[k] = std::exp2(0.5 * static_cast<double>(k) - 2.0);
  return multiples;
}

BarkBrightness learn_brightness(const BeamConfig& beams, const std::vector<StemSeenTwice>& seen) {
  BarkBrightness bark;
  const auto multiples = BarkBrightness::multiples();
  std::array<double, BarkBrightness::kSteps> logs{};
  for (std::size_t k = 0; k < multiples.size(); ++k)
    logs[k] = -0.5 * std::pow(std::log(multiples[k]) / kLogSd, 2);
  set_chances(logs, bark);
  std::map<std::size_t, int> pairs;
  for (const StemSeenTwice& pair : seen)
    ++pairs[pair.stem];
  bark.stems = static_cast<int>(pairs.size());
  const bool known = footprint_at(beams, 1.0).sd_m > 0.0;
  if (!known || bark.stems < kLeastStems) return bark;
  for (std::size_t k = 0; k < multiples.size(); ++k) {
    std::vector<Difference> differences;
    for (const StemSeenTwice& pair : seen)
      differences.push_back(difference_of(beams, pair, multiples[k], pairs[pair.stem]));
    logs[k] += log_likelihood(differences);
  }
  set_chances(logs, bark);
  double mean = 0.0;
  for (std::size_t k = 0; k < multiples.size(); ++k)
    mean += bark.chances[k] * std::log(multiples[k]);
  bark.times = std::exp(mean);
  bark.learnt = true;
  return bark;
}

BeamFootprint brightened(const BeamFootprint& beam, double times) {
  return {beam.sd_m, times * beam.signal};
}

double excess_sd_m(const BarkBrightness& bark, const BeamFootprint& beam, double radius_m,
                   double arc_deg) {
  if (!bark.learnt || !(beam.sd_m > 0.0)) return 0.0;
  const double expected = excess_radius_m(brightened(beam, bark.times), radius_m, arc_deg);
  const auto multiples = BarkBrightness::multiples();
  double square = 0.0;
  for (std::size_t k = 0; k < multiples.size(); ++k) {
    const double excess = excess_radius_m(brightened(beam, multiples[k]), radius_m, arc_deg);
    square += bark.chances[k] * (excess - expected) * (excess - expected);
  }
  return std::sqrt(square);
}

}  // namespace understory
