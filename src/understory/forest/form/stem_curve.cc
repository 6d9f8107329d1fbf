#include "understory/forest/form/stem_curve.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

#include "understory/forest/form/stem_fork.h"
#include "understory/forest/stem_curve_constants.h"
#include "understory/forest/stems/noisy_cylinder.h"
#include "understory/forest/stems/range_noise.h"
#include "understory/forest/stems/section_evidence.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace stem_constants::stem_curve;

// A section as it was fitted: radius and its standard deviation.
struct FittedSection {
  double height_m = 0.0;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
  double sd_m = 0.0;
  double seen_deg = 360.0;  // how far around it was seen
  bool breast = false;      // the stem at breast height, which all others are tied to
};

// Follows the stem from one section to the next.
class Tracker {
 public:
  Tracker(const std::vector<SlicePoint>& points, const StemFit& stem)
      : points_(points), stem_(stem) {
    form_.range_noise_m = stem.range_noise_m;
    form_.stray_reach_m = fit_reach_m(stem.range_noise_m);
  }

  // Sections away from breast height, in steps of `step_m` (negative: downwards) until `end_m`.
  void follow(double step_m, double end_m, std::vector<FittedSection>& rings) {
    FittedSection last{kBreastHeight, stem_.centre, stem_.radius_m, 0.0};
    Eigen::Vector2d slope = stem_.slope;
    double unseen_m = 0.0;
    for (double height = kBreastHeight + step_m;
         step_m > 0.0 ? height < end_m : height > end_m - 1e-9; height += step_m) {
      FittedSection guess = last;
      guess.height_m = height;
      guess.centre += step_m * slope;
      guess.radius_m += step_m * kUsualTaper;
      if (guess.radius_m < kThinnest) return;
      const auto found = fit(guess, slope);
      if (!found) {
        unseen_m += std::abs(step_m);
        if (unseen_m > kLongestGap) return;
        last = guess;
        continue;
      }
      unseen_m = 0.0;
      rings.push_back(*found);
      const double weight = kPredictionSd * kPredictionSd /
                            (kPredictionSd * kPredictionSd + found->sd_m * found->sd_m);
      last.height_m = height;
      last.radius_m = guess.radius_m + weight * (found->radius_m - guess.radius_m);
      slope += kSlopeGain / step_m * (found->centre - guess.centre);
      last.centre = found->centre;
    }
  }

 private:
  // The points between two heights around a place, with the middle height as breast height.
  std::vector<SlicePoint> window(const FittedSection& guess, const Eigen::Vector2d& slope) const {
    const auto low = static_cast<float>(guess.height_m - kHalfWindow);
    const auto high = static_cast<float>(guess.height_m + kHalfWindow);
    const double reach = guess.radius_m + fit_reach_m(stem_.range_noise_m);
    std::vector<SlicePoint> near;
    auto at = std::lower_bound(points_.begin(), points_.end(), low,
                               [](const SlicePoint& p, float h) { return p.height_m < h; });
    for (; at != points_.end() && at->height_m < high; ++at) {
      const double rise = static_cast<double>(at->height_m) - guess.height_m;
      const Eigen::Vector2d off =
          Eigen::Vector2f(at->x, at->y).cast<double>() - guess.centre - rise * slope;
      if (off.squaredNorm() > reach * reach) continue;
      SlicePoint point = *at;
      point.height_m = static_cast<float>(rise + kBreastHeight);
      near.push_back(point);
    }
    return near;
  }

  std::optional<FittedSection> fit(const FittedSection& guess, const Eigen::Vector2d& slope) const {
    const std::vector<SlicePoint> near = window(guess, slope);
    StemFit start;
    start.centre = guess.centre;
    start.slope = slope;
    start.radius_m = guess.radius_m;
    start.taper = kUsualTaper;
    start.rms_m = stem_.rms_m;
    const NoisyCylinder found = fit_noisy_cylinder(near, start, form_);
    if (!found.converged || found.strays > kMostStrays) return std::nullopt;
    const double spread = std::sqrt(std::max(1e-12, found.covariance(4, 4)));
    const double sd = std::sqrt(std::pow(kLinear * spread, 2) +
                                std::pow(kSquare * spread * spread, 2) + kMapError * kMapError);
    StemFit ring = start;
    ring.centre = found.centre;
    ring.slope = found.slope;
    ring.radius_m = found.radius_m;
    ring.taper = found.taper;
    if (sd > kMostSdShare * found.radius_m + kMostSd ||
        found.scatter_m > kMostScatterShare * found.radius_m + kMostScatter ||
        (found.centre - guess.centre).norm() > kMostShift + kMostShiftShare * guess.radius_m)
      return std::nullopt;
    // A branch or the foliage around a stem makes it thicker from one section to the next.
    const double change = found.radius_m - guess.radius_m;
    const bool flare = guess.height_m < kBreastHeight;
    const double thicker = flare ? kFlare * guess.radius_m + kMostChange
                                 : kMostThickerShare * guess.radius_m + kMostThicker;
    if (change > thicker || -change > kMostChangeShare * guess.radius_m + kMostChange)
      return std::nullopt;
    const SectionEvidence seen = section_evidence(near, ring, found.scatter_m);
    if (seen.on < kFewestPoints || seen.arc_deg < kLeastArcDeg ||
        seen.inside > kMostInside * seen.on)
      return std::nullopt;
    // The fewer points, the more the section is taken to be seen like the whole stem.
    const double own = seen.on / (seen.on + kArcPoints);
    const double seen_deg = stem_.arc_deg + own * (seen.seen_deg - stem_.arc_deg);
    return FittedSection{guess.height_m, found.centre, found.radius_m, sd, seen_deg};
  }

  NoisyCylinderConfig form_;
  const std::vector<SlicePoint>& points_;
  const StemFit& stem_;
};

double weight_of(const FittedSection& ring) {
  return 1.0 / (ring.sd_m * ring.sd_m);
}

// The form of the whole stem: its scale, and the power where the species is unknown.
struct Form {
  TaperForm taper;
  double scale = 1.0;

  [[nodiscard]] double radius(double height_m) const { return scale * taper.at(height_m); }
};

// The scale that fits the sections best, and the sum of their weighted squares.
std::pair<double, double> scale_of(const TaperForm& taper,
                                   const std::vector<FittedSection>& rings) {
  double above = 0.0;
  double below = 0.0;
  double squares = 0.0;
  for (const FittedSection& ring : rings) {
    if (ring.height_m < kFlareEnd) continue;
    const double form = taper.at(ring.height_m);
    above += weight_of(ring) * form * ring.radius_m;
    below += weight_of(ring) * form * form;
    squares += weight_of(ring) * ring.radius_m * ring.radius_m;
  }
  const double scale = below > 0.0 ? above / below : 0.0;
  return {scale, squares - scale * above};
}

Form form_of(const std::vector<FittedSection>& rings, double top_m, TaperSpecies species) {
  Form best{TaperForm(species, top_m, kUsualPower)};
  double least = std::numeric_limits<double>::infinity();
  for (double power = kLeastPower; power < kMostPower; power += kPowerStep) {
    const TaperForm taper(species, top_m, power);
    const auto [scale, squares] = scale_of(taper, rings);
    const double off = (power - kUsualPower) / kPowerSd;
    const double cost = squares / kCorrelatedRings + off * off;
    if (cost >= least) continue;
    least = cost;
    best = {taper, scale};
    if (species != TaperSpecies::kUnknown) break;
  }
  return best;
}

// Without the sections that neither their neighbours nor the form of the stem support.
std::vector<FittedSection> without_outliers(const std::vector<FittedSection>& rings,
                                            const Form& form) {
  std::vector<double> off;
  for (const FittedSection& ring : rings) {
    if (ring.height_m >= kFlareEnd) off.push_back(ring.radius_m - form.radius(ring.height_m));
  }
  const double middle = upper_median(off);
  for (double& value : off)
    value = std::abs(value - middle);
  const double spread = std::max(kLeastSpread, kSdOverMad * upper_median(off));
  std::vector<FittedSection> kept;
  for (const FittedSection& ring : rings) {
    const double error = ring.radius_m - form.radius(ring.height_m) - middle;
    if (ring.height_m < kFlareEnd || std::abs(error) < kOutlierSpreads * spread + 2.0 * ring.sd_m)
      kept.push_back(ring);
  }
  return kept;
}

// A section of the curve with what its error consists of, metres of the diameter.
struct SmoothSection {
  CurveSection section;
  double from_m = 0.0;     // height of the measured part that it follows
  double own_sd_m = 0.0;   // of the sections that were fitted, beside that of breast height
  double form_sd_m = 0.0;  // of the form, away from them
};

// The smooth curve through the sections: at each height the mean of their ratios to the form, near
// ones with more weight. Beyond the last section the ratio goes on unchanged.
class SmoothCurve {
 public:
  SmoothCurve(const std::vector<FittedSection>& rings, const Form& form, const StemFit& stem,
              double top_m)
      : rings_(rings), form_(form), stem_(stem), top_m_(top_m) {}

  [[nodiscard]] SmoothSection at(double height_m) const {
    SmoothSection smooth;
    CurveSection& section = smooth.section;
    section.height_m = height_m;
    double weights = 0.0;
    double sum = 0.0;
    double squared_weights = 0.0;
    double squares = 0.0;
    double own_squares = 0.0;
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    double nearest = std::numeric_limits<double>::infinity();
    double nearest_m = height_m;
    smooth.from_m = std::clamp(height_m, rings_.front().height_m, rings_.back().height_m);
    for (const FittedSection& ring : rings_) {
      const double away = std::abs(ring.height_m - smooth.from_m);
      if (std::abs(ring.height_m - height_m) < nearest) {
        nearest = std::abs(ring.height_m - height_m);
        nearest_m = ring.height_m;
      }
      const double weight =
          std::exp(-0.5 * std::pow(away / kSmoothing, 2)) * weight_of(ring) + 1e-12;
      weights += weight;
      sum += weight * ring.radius_m / std::max(1e-6, form_.radius(ring.height_m));
      squared_weights += weight * weight;
      squares += weight * weight * ring.sd_m * ring.sd_m;
      // What the map adds is shared with breast height, and part of its error.
      if (!ring.breast)
        own_squares += weight * weight * (ring.sd_m * ring.sd_m - kMapError * kMapError);
      centre += weight * (ring.centre - line_at(ring.height_m));
    }
    section.centre = line_at(height_m) + centre / weights;
    section.diameter_m = 2.0 * sum / weights * form_.radius(height_m);
    section.measured = nearest < kStep;
    // Neighbouring sections share points and errors of the map. One alone shares with none.
    const double together = std::min(kCorrelatedRings, weights * weights / squared_weights);
    smooth.own_sd_m = 2.0 * std::sqrt(together * own_squares) / weights;
    smooth.form_sd_m = form_error(height_m, nearest_m) * section.diameter_m;
    section.diameter_sd_m =
        std::hypot(2.0 * std::sqrt(together * squares) / weights, smooth.form_sd_m);
    return smooth;
  }

 private:
  [[nodiscard]] Eigen::Vector2d line_at(double height_m) const {
    return stem_.centre + (height_m - kBreastHeight) * stem_.slope;
  }

  // The diameter follows a power of the distance to the top, and the power is not sure. That tells
  // on how a stem goes on from where it was measured, as a share of its diameter.
  [[nodiscard]] double form_error(double height_m, double measured_m) const {
    const double left = top_m_ - height_m;
    if (!(left > 0.0)) return 0.0;
    return kPowerSd * std::abs(std::log(left / (top_m_ - measured_m)));
  }

  const std::vector<FittedSection>& rings_;
  const Form& form_;
  const StemFit& stem_;
  double top_m_;
};

// The largest distance of the centre line from a straight one.
double sweep_of(const StemCurve& curve) {
  if (!(curve.measured_to_m >= kSweepTo) || curve.sections.back().height_m < kSweepTo)
    return StemCurve::kUnknown;
  const auto first = static_cast<std::size_t>(std::lround(kSweepFrom / kSectionStep));
  const auto last = static_cast<std::size_t>(std::lround(kSweepTo / kSectionStep));
  const Eigen::Vector2d from = curve.sections[first].centre;
  const Eigen::Vector2d to = curve.sections[last].centre;
  double most = 0.0;
  for (std::size_t i = first; i <= last; ++i) {
    const double share = static_cast<double>(i - first) / static_cast<double>(last - first);
    most = std::max(most, (curve.sections[i].centre - from - share * (to - from)).norm());
  }
  return most;
}

void add_volume(const std::vector<SmoothSection>& smooth, StemCurve& curve) {
  double volume = 0.0;
  double above = 0.0;     // of it, beyond the last section that was measured
  double form = 0.0;      // errors of the volume: the form's are the same error at all heights ...
  double variance = 0.0;  // ... and sections share theirs with those near them
  double below = 0.0;     // errors of sections farther down, as far as they are shared
  for (std::size_t i = 1; i < smooth.size(); ++i) {
    const CurveSection& a = smooth[i - 1].section;
    const CurveSection& b = smooth[i].section;
    const double length = b.height_m - a.height_m;
    // A cone between two sections.
    const double part =
        M_PI / 12.0 * length *
        (a.diameter_m * a.diameter_m + a.diameter_m * b.diameter_m + b.diameter_m * b.diameter_m);
    volume += part;
    if (a.height_m >= curve.measured_to_m) above += part;
    const double per_diameter = M_PI / 4.0 * length * (a.diameter_m + b.diameter_m);
    form += 0.5 * per_diameter * (smooth[i - 1].form_sd_m + smooth[i].form_sd_m);
    const double own = 0.5 * per_diameter * (smooth[i - 1].own_sd_m + smooth[i].own_sd_m);
    const double apart = smooth[i].from_m - smooth[i - 1].from_m;
    below *= std::exp(-apart / (kCorrelatedRings * kStep));
    variance += own * own + 2.0 * own * below;
    below += own;
  }
  curve.volume_m3 = volume;
  curve.volume_form_sd_m3 = std::sqrt(variance + form * form);
  const double unseen = curve.sections.back().height_m - curve.measured_to_m;
  curve.volume_per_height_m2 = unseen > 0.0 ? above / unseen : 0.0;
}

// What the sections around breast height are thicker than the stem there. Its radius rests on many
// more points than theirs, and the same errors stay in all sections. They have the weight of one
// section more, which has no offset.
double offset_at_breast_height(const StemFit& stem, const std::vector<FittedSection>& below,
                               const std::vector<FittedSection>& above) {
  double sums[2] = {0.0, 0.0};
  int counts[2] = {0, 0};
  for (const std::vector<FittedSection>* part : {&below, &above}) {
    for (const FittedSection& ring : *part) {
      const double rise = ring.height_m - kBreastHeight;
      if (std::abs(rise) > kAnchorReach) continue;
      const std::size_t side = rise > 0.0 ? 1 : 0;
      sums[side] += ring.radius_m - stem.radius_m - kUsualTaper * rise;
      ++counts[side];
    }
  }
  const int both = counts[0] + counts[1];
  return (sums[0] + sums[1]) / (both + kAnchorPrior);
}

// All sections upwards, without the part of their radii that wide beams add. They are followed as
// the points show them: from the radius at breast height with that part.
std::vector<FittedSection> sections_of(const std::vector<SlicePoint>& points, const StemFit& stem,
                                       double top_m) {
  std::vector<FittedSection> rings;
  StemFit shown = stem;
  shown.radius_m += stem.beam_excess_m;
  Tracker tracker(points, shown);
  tracker.follow(-kStep, kLowest, rings);
  std::reverse(rings.begin(), rings.end());
  std::vector<FittedSection> above;
  tracker.follow(kStep, top_m - kStep, above);
  for (std::vector<FittedSection>* part : {&rings, &above}) {
    for (FittedSection& ring : *part)
      ring.radius_m -= excess_radius_m(stem.beam, ring.radius_m, ring.seen_deg);
  }
  const double offset = offset_at_breast_height(stem, rings, above);
  for (std::vector<FittedSection>* part : {&rings, &above}) {
    for (FittedSection& ring : *part)
      ring.radius_m -= offset;
  }
  rings.push_back({kBreastHeight, stem.centre, stem.radius_m,
                   std::sqrt(std::max(0.0, stem.covariance(2, 2))) + kMapError, 360.0, true});
  rings.insert(rings.end(), above.begin(), above.end());
  return rings;
}

}  // namespace

StemCurve measure_stem_curve(std::vector<SlicePoint> points, const StemFit& stem, double height_m,
                             const StemCurveConfig& config) {
  std::sort(points.begin(), points.end(), [](const SlicePoint& a, const SlicePoint& b) {
    return std::tie(a.height_m, a.x, a.y) < std::tie(b.height_m, b.x, b.y);
  });
  const double highest = points.empty() ? 0.0 : static_cast<double>(points.back().height_m);
  const double top = std::isfinite(height_m) ? height_m : highest;
  std::vector<FittedSection> rings = sections_of(points, stem, top);
  StemCurve curve;
  // Without a height the form serves as an outline only: it ends well above what was seen.
  const double outline = std::isfinite(height_m) ? height_m : kUnknownTop * rings.back().height_m;
  if (outline < kLeastTop) return curve;
  Form form = form_of(rings, outline, config.species);
  rings = without_outliers(rings, form);
  form = form_of(rings, outline, config.species);
  curve.measured_to_m = rings.back().height_m;
  const SmoothCurve smooth(rings, form, stem, outline);
  const double end = std::isfinite(height_m) ? height_m : curve.measured_to_m;
  const auto count = static_cast<int>(std::floor(end / kSectionStep));
  std::vector<SmoothSection> sections;
  for (int i = 0; i <= count; ++i)
    sections.push_back(smooth.at(i * kSectionStep));
  for (const SmoothSection& section : sections)
    curve.sections.push_back(section.section);
  curve.sweep_m = sweep_of(curve);
  curve.fork = find_fork(points, curve);
  if (!std::isfinite(height_m)) return curve;
  if (end > count * kSectionStep + kSameHeight) {
    sections.push_back(smooth.at(end));
    curve.sections.push_back(sections.back().section);
  }
  add_volume(sections, curve);
  return curve;
}

double volume_sd_m3(const StemCurve& curve, double dbh_sd_share, double height_sd_m) {
  return std::hypot(curve.volume_form_sd_m3, 2.0 * dbh_sd_share * curve.volume_m3,
                    curve.volume_per_height_m2 * height_sd_m);
}

}  // namespace understory
