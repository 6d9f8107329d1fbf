#include "understory/forest/stems/blurred_stems.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "understory/forest/blur_constants.h"
#include "understory/util/median.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace blur_constants;

bool overlap(const StemFit& a, const StemFit& b) {
  return (a.centre - b.centre).norm() < a.radius_m + b.radius_m;
}

// Whether the thick stem is what the points of the thin one belong to.
bool covers(const StemFit& thick, const StemFit& thin) {
  return thick.radius_m > kCoverRadii * thin.radius_m &&
         thick.returns > kCoverReturns * thin.returns;
}

}  // namespace

double blur_of(const std::vector<StemFit>& stems) {
  std::vector<double> scatters;
  for (const StemFit& stem : stems)
    scatters.push_back(stem.scatter_m);
  if (scatters.size() < kFewestForBlur) return 0.0;
  const double scatter = upper_median(std::move(scatters));
  if (scatter < kLeastBlur) return 0.0;
  return std::min(kBlurStep * std::round(scatter / kBlurStep), kMostBlur);
}

void take_blurred(std::vector<StemFit> blurred, BlurredRole role, std::vector<StemFit>& stems) {
  sort_by_place(blurred);
  sort_stably(blurred, [](const StemFit& a, const StemFit& b) { return a.returns > b.returns; });
  std::vector<char> fixed(stems.size(), 0);
  for (StemFit& stem : blurred) {
    std::size_t met = stems.size();
    std::size_t count = 0;
    for (std::size_t i = 0; i < stems.size(); ++i) {
      if (!overlap(stem, stems[i])) continue;
      met = i;
      ++count;
    }
    if (count == 0 && role == BlurredRole::kCoversOrIsNew) {
      stems.push_back(std::move(stem));
      fixed.push_back(1);
    } else if (count == 1 && fixed[met] == 0 && covers(stem, stems[met])) {
      stems[met] = std::move(stem);
      fixed[met] = 1;
    }
  }
  sort_by_place(stems);
}

std::string blur_note(double blur_m, double range_noise_m) {
  const std::string cause =
      range_noise_m > 0.0
          ? fmt::format("Most of it lies along the beams: the ranges have {:.1f} cm of noise",
                        100.0 * range_noise_m)
          : std::string("It goes to all sides: the path has errors, or the cloud was processed");
  return fmt::format(
      "the cloud is blurred: points scatter by {:.0f} cm about the stems (median). {}. Stems "
      "thinner than {:.0f} cm may be missing, or far too thick",
      100.0 * blur_m, cause, 100.0 * 2.0 * kLeastRadiusBlurs * blur_m);
}

double add_blurred_stems(const StemDetectorConfig& config, const CutSearch& search,
                         std::vector<StemFit>& stems) {
  StemDetectorConfig blurred = config;
  // The stems that thin slices show are the clearest ones: those of the first round tell more.
  for (int round = 0; round < kBlurRounds; ++round) {
    const double blur = blur_of(stems);
    if (blur <= blurred.blur_m) break;
    blurred.blur_m = blur;
    StemDetectorConfig thick = blurred;
    thick.min_dbh_m = std::max(config.min_dbh_m, 2.0 * kLeastRadiusBlurs * blur);
    take_blurred(search(StemCut::kBlurred, thick), BlurredRole::kCoversOrIsNew, stems);
  }
  if (blurred.blur_m == 0.0) return 0.0;
  for (const StemCut cut : {StemCut::kThin, StemCut::kThick})
    take_blurred(search(cut, blurred), BlurredRole::kCovers, stems);
  return blurred.blur_m;
}

}  // namespace understory
