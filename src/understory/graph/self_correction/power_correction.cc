#include "understory/graph/self_correction/power_correction.h"

#include <algorithm>
#include <cmath>

#include "understory/util/error.h"
#include "understory/util/index.h"

namespace understory {
namespace {

// Sums of `step(k)` for k = j + 1..l, over that for k = j + 1..i. They begin at j + 1, as a step
// belongs to the view that it leads to. The sums as printed begin at j and would not be 0 there.
template <typename Step>
std::vector<double> cumulative(int j, int i, const Step& step) {
  std::vector<double> u(at(i - j + 1), 0.0);
  for (int l = j + 1; l <= i; ++l)
    u[at(l - j)] = u[at(l - j - 1)] + step(l);
  const double whole = u.back();
  for (double& value : u)
    value = whole > 0.0 ? value / whole : 0.0;
  return u;
}

// The u in [0, 1] for which j (j^-1 i)^u lies nearest to l, P0 (32). A coarse search comes first,
// then a golden one around the best: the distance may have several minima on a path with loops.
double nearest_on_screw(const Pose& j_from_i, const Pose& j_from_l, const PowerConfig& config) {
  const auto distance = [&](double u) {
    return motion_metric(j_from_i.power(u).inverse() * j_from_l, config);
  };
  constexpr int kCoarse = 16;
  int best = 0;
  double least = distance(0.0);
  for (int k = 1; k <= kCoarse; ++k) {
    const double d = distance(static_cast<double>(k) / kCoarse);
    if (d < least) {
      least = d;
      best = k;
    }
  }
  double low = std::max(0.0, (best - 1.0) / kCoarse);
  double high = std::min(1.0, (best + 1.0) / kCoarse);
  constexpr double kGolden = 0.6180339887498949;
  for (int k = 0; k < 30; ++k) {
    const double a = high - kGolden * (high - low);
    const double b = low + kGolden * (high - low);
    (distance(a) < distance(b) ? high : low) = distance(a) < distance(b) ? b : a;
  }
  return 0.5 * (low + high);
}

}  // namespace

double motion_metric(const Pose& motion, const PowerConfig& config) {
  const double theta = motion.angle();
  return std::sqrt(config.metric_rotation_m2 * theta * theta +
                   config.metric_translation * motion.translation().squaredNorm());
}

std::vector<double> power_coefficients(const std::vector<Pose>& world_from_view,
                                       const std::vector<double>& step_errors, int j, int i,
                                       const PowerConfig& config) {
  UNDERSTORY_CHECK(0 <= j && j < i && at(i) < world_from_view.size());
  const Pose j_from_world = world_from_view[at(j)].inverse();
  const Pose j_from_i = j_from_world * world_from_view[at(i)];
  std::vector<double> u;
  switch (config.coefficient) {
    case PowerCoefficient::kIndex:
      break;
    case PowerCoefficient::kPathLength:
      u = cumulative(j, i, [&](int l) {
        return (world_from_view[at(l)].translation() - world_from_view[at(l - 1)].translation())
            .norm();
      });
      break;
    case PowerCoefficient::kMatchError:
      UNDERSTORY_CHECK(step_errors.size() == world_from_view.size());
      u = cumulative(j, i, [&](int l) { return step_errors[at(l)]; });
      break;
    case PowerCoefficient::kMetric: {
      const double whole = motion_metric(j_from_i, config);
      for (int l = j; whole > 0.0 && l <= i; ++l)
        u.push_back(motion_metric(j_from_world * world_from_view[at(l)], config) / whole);
      break;
    }
    case PowerCoefficient::kScrew:
      if (motion_metric(j_from_i, config) <= 0.0) break;
      for (int l = j; l <= i; ++l)
        u.push_back(nearest_on_screw(j_from_i, j_from_world * world_from_view[at(l)], config));
      break;
  }
  if (u.empty() || u.back() == 0.0) u = cumulative(j, i, [](int) { return 1.0; });
  u.front() = 0.0;
  u.back() = 1.0;
  return u;
}

void apply_power_correction(std::vector<Pose>& world_from_view,
                            const std::vector<double>& step_errors, int j, int i,
                            const Pose& j_from_i, const PowerConfig& config) {
  const std::vector<double> u = power_coefficients(world_from_view, step_errors, j, i, config);
  const Pose world_from_j = world_from_view[at(j)];
  const Pose j_from_world = world_from_j.inverse();
  const Pose before = j_from_world * world_from_view[at(i)];
  const bool printed = config.form == PowerForm::kPrinted;
  const Pose correction = printed ? before.inverse() * j_from_i : j_from_i * before.inverse();
  const Pose tail_from_tail = world_from_j * j_from_i * world_from_view[at(i)].inverse();
  for (int l = j + 1; l <= i; ++l) {
    const Pose j_from_l = j_from_world * world_from_view[at(l)];
    const Pose share = correction.power(std::clamp(u[at(l - j)], 0.0, 1.0));
    world_from_view[at(l)] = world_from_j * (printed ? j_from_l * share : share * j_from_l);
  }
  for (std::size_t k = at(i) + 1; k < world_from_view.size(); ++k)
    world_from_view[k] = tail_from_tail * world_from_view[k];
}

}  // namespace understory
