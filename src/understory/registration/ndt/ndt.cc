#include "understory/registration/ndt/ndt.h"

#include <algorithm>
#include <vector>

#include "understory/registration/describe_steps.h"
#include "understory/registration/judged_match.h"
#include "understory/registration/registration_constants.h"
#include "understory/util/error.h"

namespace understory {

using namespace registration_constants::ndt;

void describe(ConfigTable& table, NdtConfig& config) {
  using Search = NdtConfig::Search;
  table.add_enum("search", config.search,
                 {{"1", Search::k1}, {"7", Search::k7}, {"8", Search::k8}, {"27", Search::k27}},
                 "cells looked at for a point: its own, with face neighbours, the 8 around it "
                 "(weighted by nearness), or all 27");
  table.add_enum(
      "hessian", config.hessian,
      {{"gauss_newton", NdtConfig::Hessian::kGaussNewton}, {"newton", NdtConfig::Hessian::kNewton}},
      "curvature used for the steps");
  table.add("outlier_ratio", config.outlier_ratio, {0.01, 0.95}, "",
            "share of points expected to match nothing");
  table.add("widening", config.widening, {1.0, 20.0}, "",
            "the first steps see normals this much wider; 1 = no such steps");
  table.add("wide_until_m", config.wide_until_m, {1e-4, 1.0}, "m",
            "the first steps end when one is shorter");
  internal::describe_steps(table, config);
}

RegistrationResult register_ndt(const NdtMap& target, const NdtSource& source, const Pose& guess,
                                const PoseTerms& terms, const NdtConfig& config,
                                const NdtMap* coarser) {
  if (target.empty())
    return internal::refused(RegistrationStatus::kTooFewPoints, "empty target", guess);
  if (source.size() < static_cast<std::size_t>(config.min_matches)) {
    return internal::refused(RegistrationStatus::kTooFewPoints,
                             "only " + std::to_string(source.size()) + " source points", guess);
  }
  const double range = internal::mean_range(source.points);
  double widening = config.widening;
  MatchSums sums;
  Pose summed_at;
  const Points few_points = thin_evenly(source.points, kEnoughForWideSteps, kWideEvery);
  const std::vector<std::uint8_t> few_lidars =
      thin_evenly(source.lidars, kEnoughForWideSteps, kWideEvery);
  const NdtSource few(few_points, few_lidars);
  const auto evaluate = [&](const Pose& pose) {
    sums = ndt_cost(target, widening > 1.0 ? few : source, pose, config, widening, coarser);
    summed_at = pose;
    const double share = config.independent_share;
    PoseCost sum{share * sums.cost, share * sums.gradient, share * sums.hessian};
    internal::add_terms(terms, pose, share * static_cast<double>(sums.matched), sum);
    return sum;
  };
  internal::StepLimits limits{config.max_iterations, config.step_translation_m,
                              config.step_rotation_rad, config.max_step_m, range};
  internal::Minimum minimum{guess, {}, 0, false};
  // From far away a narrow normal has no pull: wide ones first, until the steps become short.
  int wide_iterations = 0;
  limits.step_translation_m = config.wide_until_m;
  limits.step_rotation_rad = config.wide_until_m / range;
  limits.trust_last_step = true;
  for (; widening > 1.0; widening *= 0.5) {
    minimum = internal::minimise(evaluate, minimum.pose, limits);
    wide_iterations += minimum.iterations;
  }
  widening = 1.0;
  limits.step_translation_m = config.step_translation_m;
  limits.step_rotation_rad = config.step_rotation_rad;
  limits.trust_last_step = false;
  minimum = internal::minimise(evaluate, minimum.pose, limits);
  minimum.iterations += wide_iterations;

  const bool exact = config.hessian == NdtConfig::Hessian::kNewton;
  if (exact || summed_at.matrix() != minimum.pose.matrix()) {
    NdtConfig plain = config;  // information has to be positive
    plain.hessian = NdtConfig::Hessian::kGaussNewton;
    sums = ndt_cost(target, source, minimum.pose, plain, 1.0, coarser);
  }
  return internal::judged_match(minimum, sums, source.points, range, guess,
                                internal::Judgement(config));
}

RegistrationResult register_ndt(std::span<const NdtMapPtr> targets, const NdtSource& source,
                                const Pose& guess, const PoseTerms& terms, const NdtConfig& config,
                                const NdtMap* coarser) {
  UNDERSTORY_CHECK(!targets.empty());
  RegistrationResult result;
  Pose start = guess;
  int iterations = 0;
  for (const NdtMapPtr& target : targets) {
    const bool last = &target == &targets.back();
    result = register_ndt(*target, source, start, terms, config, last ? coarser : nullptr);
    iterations += result.iterations;
    if (!result.usable()) {
      result.target_from_source = guess;
      break;
    }
    start = result.target_from_source;
  }
  result.iterations = iterations;
  return result;
}

}  // namespace understory
