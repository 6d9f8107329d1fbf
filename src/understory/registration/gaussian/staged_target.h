#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "understory/registration/gaussian/gaussian_match.h"
#include "understory/registration/matcher.h"
#include "understory/registration/wide_steps.h"

// The seam's target and cost for all methods that match to Gaussians.
namespace understory::internal {

// One stage of a match, from wide to fine. `Target` as in gaussian_match.h, with
//   GaussianSource source_of(const Points&) const;   what a source becomes for it
template <typename Target>
struct GaussianStage {
  std::shared_ptr<const Target> target;
  GaussianStepsConfig steps;
};

// The cost of one stage.
template <typename Target>
class GaussianMatchCost : public MatchCost {
 public:
  GaussianMatchCost(const GaussianStage<Target>& stage, const Points& source)
      : stage_(stage), source_(stage.target->source_of(source)) {}
  [[nodiscard]] PoseCost at(const Pose& target_from_source) const override {
    std::vector<typename Target::Known> known(source_.means.size());
    return gaussian_cost(
        gaussian_sums(*stage_.target, source_, target_from_source, stage_.steps, known),
        stage_.steps);
  }
  [[nodiscard]] double step_translation_m() const override {
    return stage_.steps.step_translation_m;
  }
  [[nodiscard]] double step_rotation_rad() const override { return stage_.steps.step_rotation_rad; }

 private:
  GaussianStage<Target> stage_;
  GaussianSource source_;
};

// A target of one or more stages; the last is the fine one that MatchStart::kNear has alone.
template <typename Target>
class StagedTarget : public MatchTarget {
 public:
  // `same_source`: all stages see the source in the same way.
  StagedTarget(std::vector<GaussianStage<Target>> stages, double reach_m, bool same_source)
      : stages_(std::move(stages)), reach_m_(reach_m), same_source_(same_source) {}

  [[nodiscard]] RegistrationResult match(const Points& points, const Pose& guess,
                                         const PoseTerms& terms, MatchStart start) const override {
    RegistrationResult result;
    result.target_from_source = guess;
    int iterations = 0;
    GaussianSource source;
    for (std::size_t i = start == MatchStart::kFar ? 0 : stages_.size() - 1; i < stages_.size();
         ++i) {
      const auto& [target, steps] = stages_[i];
      if (source.means.empty() || !same_source_) source = target->source_of(points);
      const bool wide = i + 1 < stages_.size();
      result = gaussian_match(*target, wide ? wide_part_of(source) : source,
                              result.target_from_source, terms, wide ? wide_steps(steps) : steps);
      iterations += result.iterations;
      if (!result.usable()) break;
    }
    result.iterations = iterations;
    if (!result.usable()) result.target_from_source = guess;
    return result;
  }
  [[nodiscard]] double reach_m() const override { return reach_m_; }
  [[nodiscard]] std::size_t size() const override { return stages_.back().target->size(); }
  [[nodiscard]] std::unique_ptr<const MatchCost> cost(const Points& source,
                                                      MatchStart start) const override {
    return std::make_unique<GaussianMatchCost<Target>>(
        start == MatchStart::kFar ? stages_.front() : stages_.back(), source);
  }

 private:
  [[nodiscard]] static GaussianSource wide_part_of(const GaussianSource& source) {
    return {wide_part(source.means), wide_part(source.covariances), wide_part(source.features)};
  }

  std::vector<GaussianStage<Target>> stages_;
  double reach_m_;
  bool same_source_;
};

}  // namespace understory::internal
