#pragma once

#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "understory/util/config/config.h"
#include "understory/util/parallel.h"

namespace understory {

// How much a residual counts, by its size: the M-estimators and trimmed sets that ICP is used with.
enum class LossKind {
  kNone,          // as its square
  kHuber,         // far ones by their size
  kTukey,         // far ones nothing (biweight)
  kCauchy,        // far ones by the logarithm
  kGemanMcClure,  // far ones hardly
  kWelsch,        // far ones nothing, smoothly
  kTrimmed,       // only the smallest share (trimmed ICP, Chetverikov et al. 2002)
  kVarTrimmed,    // the same, the share chosen by the residuals (Phillips et al. 2007)
};

// The settings of a loss. The scale itself is a setting of the method, in its own unit.
struct RobustLossConfig {
  LossKind kind = LossKind::kGemanMcClure;
  // The scale comes from the median residual of each step, times the constant that makes the loss
  // 95 % efficient for normal errors. False: it is the method's setting.
  bool estimate_scale = false;
  double trim_share = 0.8;  // kTrimmed: the share of residuals that counts, 0..1
};
void describe(ConfigTable& table, RobustLossConfig& config);

// Whether a loss depends on all residuals of a step together.
[[nodiscard]] bool needs_residuals(const RobustLossConfig& config);

// One loss with its scale. Squared residuals are >= 0, in the squared unit of the scale.
class RobustLoss {
 public:
  // `squared_scale` > 0; of a trimmed set the largest squared residual that counts.
  RobustLoss(LossKind kind, double squared_scale) : kind_(kind), scale_(squared_scale) {}

  struct Value {
    double loss = 0.0;    // takes the place of the squared residual in the cost
    double weight = 0.0;  // its derivative by the squared residual, 0..1
  };
  [[nodiscard]] Value at(double squared) const {
    switch (kind_) {
      case LossKind::kGemanMcClure: {
        const double share = scale_ / (scale_ + squared);
        return {share * squared, share * share};
      }
      case LossKind::kHuber: {
        if (squared <= scale_) return {squared, 1.0};
        const double ratio = std::sqrt(scale_ / squared);
        return {2.0 * ratio * squared - scale_, ratio};
      }
      case LossKind::kTukey: {
        const double left = squared < scale_ ? 1.0 - squared / scale_ : 0.0;
        return {scale_ / 3.0 * (1.0 - left * left * left), left * left};
      }
      case LossKind::kCauchy:
        return {scale_ * std::log1p(squared / scale_), scale_ / (scale_ + squared)};
      case LossKind::kWelsch: {
        const double left = std::exp(-squared / scale_);
        return {scale_ * (1.0 - left), left};
      }
      case LossKind::kTrimmed:
      case LossKind::kVarTrimmed:
        return squared <= scale_ ? Value{squared, 1.0} : Value{scale_, 0.0};
      case LossKind::kNone:
        break;
    }
    return {squared, 1.0};
  }
  // The loss of a point without a match: as much as the worst match, so that leaving is no gain.
  // `most`: the largest squared residual that a match can have.
  [[nodiscard]] double of_unmatched(double most) const {
    switch (kind_) {
      case LossKind::kGemanMcClure:
      case LossKind::kWelsch:
      case LossKind::kTrimmed:
      case LossKind::kVarTrimmed:
        return scale_;
      case LossKind::kTukey:
        return scale_ / 3.0;
      default:
        return at(most).loss;
    }
  }

 private:
  LossKind kind_;
  double scale_;
};

// The loss for residuals as they are now. `squared`: those of the matched points, in any order;
// `fixed_scale` > 0: the method's setting, used where nothing is estimated or nothing matched.
[[nodiscard]] RobustLoss fitted_loss(std::vector<float> squared, double fixed_scale,
                                     const RobustLossConfig& config);

// The loss for a step over `n` points. `squared_of(i)`: squared residual of point i, NaN without a
// match; asked only if the loss depends on the residuals. Parallel; same bits for any number of
// threads.
template <typename SquaredOf>
[[nodiscard]] RobustLoss loss_of_step(std::size_t n, double fixed_scale,
                                      const RobustLossConfig& config, const SquaredOf& squared_of) {
  if (!needs_residuals(config)) return {config.kind, fixed_scale * fixed_scale};
  std::vector<float> squared(n);
  parallel_for(n, 256, [&](std::size_t i) { squared[i] = static_cast<float>(squared_of(i)); });
  std::erase_if(squared, [](float value) { return !(value >= 0.0F); });
  return fitted_loss(std::move(squared), fixed_scale, config);
}

}  // namespace understory
