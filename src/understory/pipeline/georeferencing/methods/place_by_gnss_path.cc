#include <fmt/format.h>

#include <cmath>

#include "understory/georeference/satellites/gnss_fit.h"
#include "understory/pipeline/georeferencing/gnss_fixes.h"
#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/pipeline/georeferencing/methods/satellite_placement.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"

namespace understory {

using namespace pipeline_constants::georeferencing;

Placement place_by_gnss_path(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  const NamedFixes named = fixes_of_run(request.gnss, request.run, run.fixes, log);
  const GnssFit fit =
      fit_to_gnss(run.trajectory, antenna_of(request, run, log), named.fixes, request.path);
  if (!fit.path.found) throw InputError(named.file, "", fit.path.reason);
  Placement placement;
  placement.target_from_world = fit.enu_from_world;
  placement.origin = fit.origin;
  placement.figures = figures_of(fit);
  placement.summary = fmt::format(
      "{} fixes; fit {:.2f} m (symmetric, root mean square); fixes off the path by {:.2f} m in the "
      "median, {:.2f} m in the mean",
      fit.fixes.size(), fit.path.symmetric_rms_m, fit.path.fixes_median_m, fit.path.fixes_mean_m);
  if (fit.fixes_in_time > 0 && std::isfinite(fit.along_rms_m))
    placement.summary += fmt::format("; {:.2f} m along and {:.2f} m across the path by time",
                                     fit.along_rms_m, fit.across_rms_m);
  if (fit.ambiguous)
    placement.doubt(
        fmt::format("the path fits as well the other way round ({:.2f} m against {:.2f} m), and "
                    "the times do not show which is right",
                    fit.path.turned_rms_m, fit.path.symmetric_rms_m));
  if (fit.path.heading_sd_deg > kMostHeadingSdDeg)
    placement.doubt(fmt::format(
        "the heading is uncertain by {:.1f} degrees (one standard deviation; {:.0f} at most). The "
        "path is too short, too straight or too round for fixes that are {:.1f} m off it. Take a "
        "longer path with bends, or a better receiver",
        fit.path.heading_sd_deg, kMostHeadingSdDeg, fit.path.fixes_rms_m));
  placement.gnss = rows_of(fit.fixes, "too far from the path");
  if (request.gnss.empty())
    placement.inputs.push_back(hash_input(named.file));
  else
    placement.inputs = hash_inputs(request.gnss, log, request.progress);
  return placement;
}

}  // namespace understory
