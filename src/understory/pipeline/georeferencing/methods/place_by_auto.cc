#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/pipeline/georeferencing/methods/satellite_placement.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

// A method that was tried, and what it made one expect.
struct TriedMethod {
  const char* name;
  SatelliteFit fit;
};

// Standard deviation of the fit's tilt, the worse of both axes. A short path hardly tells it, and
// an error of the path itself does not show that.
double fitted_tilt_sd_deg(const SatelliteFit& fit) {
  const Eigen::Matrix3d turn = fit.enu_from_world.rotation().toRotationMatrix();
  const Eigen::Matrix3d spread = turn * fit.covariance.topLeftCorner<3, 3>() * turn.transpose();
  return std::sqrt(std::max(spread(0, 0), spread(1, 1))) / kDegree;
}

bool is_level(const SatelliteFit& fit) {
  return fitted_tilt_sd_deg(fit) <= pipeline_constants::georeferencing::kMostHeadingSdDeg;
}

// The smallest expected error, of those that know the tilt where any does. Null: none was found.
const TriedMethod* best_of(const std::vector<TriedMethod>& tried) {
  const TriedMethod* best = nullptr;
  for (const TriedMethod& one : tried) {
    if (!one.fit.found) continue;
    const auto rank = [](const SatelliteFit& fit) {
      return std::pair(!is_level(fit), fit.expected_error_m);
    };
    if (best == nullptr || rank(one.fit) < rank(best->fit)) best = &one;
  }
  return best;
}

std::string account_of(const std::vector<TriedMethod>& tried, const TriedMethod& best) {
  std::string text = fmt::format("auto: {} has the smallest expected error, {:.2f} m", best.name,
                                 best.fit.expected_error_m);
  for (const TriedMethod& other : tried) {
    if (&other == &best) continue;
    text += other.fit.found ? fmt::format("; {} {:.2f} m", other.name, other.fit.expected_error_m)
                            : fmt::format("; {} cannot be used: {}", other.name, other.fit.reason);
    if (other.fit.found && is_level(best.fit) && !is_level(other.fit))
      text += fmt::format(" and {:.0f} degrees of tilt", fitted_tilt_sd_deg(other.fit));
  }
  return text;
}

// What keeps the methods by time from these fixes.
struct NoCommonTime {
  std::filesystem::path file;
  std::string reason;
};

// The times are the first thing to look at: what the paths alone tell comes behind.
Placement place_without_clock(const GeoreferenceRequest& request, const MovableRun& run,
                              const NoCommonTime& times, Log& log) {
  try {
    Placement placement = place_by_gnss_path(request, run, log);
    placement.method = "gnss-path";
    placement.summary =
        "auto: no fix is of a time of the run, so the paths were compared without a clock\n" +
        placement.summary;
    placement.doubts.insert(placement.doubts.begin(), times.reason);
    return placement;
  } catch (const InputError& error) {
    throw InputError(times.file.string(), "", times.reason + " (tried: " + reason_of(error) + ")");
  }
}

}  // namespace

Placement place_by_best(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  const SatelliteInput input = read_satellite_input(request, run, log);
  std::vector<TriedMethod> tried;
  const char* names[] = {"split", "fit3", "closed"};
  const std::vector<SatelliteFit> fits = fits_to_satellites(
      run.trajectory, input.fixes,
      {SatelliteMethod::kSplit, SatelliteMethod::kFit3, SatelliteMethod::kClosed}, input.config);
  for (std::size_t k = 0; k < fits.size(); ++k)
    tried.push_back({names[k], fits[k]});
  const TriedMethod* best = best_of(tried);
  if (best == nullptr && tried.front().fit.fixes_in_time == 0)
    return place_without_clock(request, run, {input.file, tried.front().fit.reason}, log);
  if (best == nullptr)
    return placement_of(request, run, input, tried.front().fit, tried.front().name, log);
  Placement placement = placement_of(request, run, input, best->fit, best->name, log);
  const auto& headings = tried.front().fit.headings;
  if (best != &tried.front() && headings) warn_of_headings(*headings, log);
  for (const TriedMethod& one : tried) {
    if (one.fit.found)
      placement.figures[fmt::format("expected_error_{}_m", one.name)] = one.fit.expected_error_m;
  }
  placement.summary = account_of(tried, *best) + "\n" + placement.summary;
  return placement;
}

}  // namespace understory
