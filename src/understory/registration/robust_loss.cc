#include "understory/registration/robust_loss.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "understory/registration/registration_constants.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace registration_constants::robust_loss;

double width_of(LossKind kind) {
  switch (kind) {
    case LossKind::kHuber:
      return kHuberWidth;
    case LossKind::kTukey:
      return kBiweightReach;
    case LossKind::kCauchy:
      return kCauchyWidth;
    case LossKind::kWelsch:
      return kWelschWidth;
    default:
      return kGemanMcClureWidth;
  }
}

// The largest squared residual of the smallest `share`.
double trimmed_limit(std::vector<float>& squared, double share) {
  const auto last = static_cast<double>(squared.size() - 1);
  const auto at = static_cast<std::ptrdiff_t>(std::clamp(share, 0.0, 1.0) * last);
  std::nth_element(squared.begin(), squared.begin() + at, squared.end());
  return static_cast<double>(squared[static_cast<std::size_t>(at)]);
}

// Fractional root mean squared distance, Phillips et al. 2007 (4): the share f whose residuals have
// the smallest RMS / f^lambda. The limit is the largest squared residual within it.
double var_trimmed_limit(std::vector<float>& squared) {
  std::sort(squared.begin(), squared.end());
  const auto n = static_cast<double>(squared.size());
  double sum = 0.0;
  double best = std::numeric_limits<double>::infinity();
  double limit = static_cast<double>(squared.back());
  for (std::size_t i = 0; i < squared.size(); ++i) {
    sum += static_cast<double>(squared[i]);
    const auto count = static_cast<double>(i + 1);
    if (count < kLeastShare * n) continue;
    // The square of the ratio: smallest at the same place.
    const double value = sum / count * std::pow(n / count, 2.0 * kFractionPower);
    if (value >= best) continue;
    best = value;
    limit = static_cast<double>(squared[i]);
  }
  return limit;
}

}  // namespace

void describe(ConfigTable& table, RobustLossConfig& config) {
  table.add_enum("kernel", config.kind,
                 {{"none", LossKind::kNone},
                  {"huber", LossKind::kHuber},
                  {"tukey", LossKind::kTukey},
                  {"cauchy", LossKind::kCauchy},
                  {"geman_mcclure", LossKind::kGemanMcClure},
                  {"welsch", LossKind::kWelsch},
                  {"trimmed", LossKind::kTrimmed},
                  {"var_trimmed", LossKind::kVarTrimmed}},
                 "how little a match far apart counts");
  table.add("kernel_estimated", config.estimate_scale,
            "the scale of the kernel comes from the median residual of each step");
  table.add("trim_share", config.trim_share, {0.05, 1.0}, "",
            "kernel trimmed: share of the matches that counts");
}

bool needs_residuals(const RobustLossConfig& config) {
  return config.kind == LossKind::kTrimmed || config.kind == LossKind::kVarTrimmed ||
         (config.estimate_scale && config.kind != LossKind::kNone);
}

RobustLoss fitted_loss(std::vector<float> squared, double fixed_scale,
                       const RobustLossConfig& config) {
  const double fixed = fixed_scale * fixed_scale;
  if (squared.empty() || !needs_residuals(config)) return {config.kind, fixed};
  // Below this share of the setting a scale is the noise of rounding.
  const double least = kLeastScale * kLeastScale * fixed;
  if (config.kind == LossKind::kTrimmed)
    return {config.kind, std::max(least, trimmed_limit(squared, config.trim_share))};
  if (config.kind == LossKind::kVarTrimmed)
    return {config.kind, std::max(least, var_trimmed_limit(squared))};
  const double median = static_cast<double>(upper_median(std::move(squared)));
  const double scale = width_of(config.kind) * kSdOverMad;
  return {config.kind, std::max(least, scale * scale * median)};
}

}  // namespace understory
