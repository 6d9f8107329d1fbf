#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

#include "understory/forest/ground_area.h"
#include "understory/forest/stems/beam_footprint.h"
#include "understory/util/config/config.h"
#include "understory/util/progress.h"

namespace understory {

// A point near breast height: metres relative to `origin` of the search, and above the ground.
struct SlicePoint {
  float x = 0.0F;
  float y = 0.0F;
  float height_m = 0.0F;
  std::uint32_t returns = 1;  // points of the cloud that this one stands for
};

// Which slices of a cloud are searched, and what counts as a stem there.
struct StemDetectorConfig {
  double lowest_m = 0.5;   // above ground: slices from here ...
  double highest_m = 3.5;  // ... to here
  double slice_m = 0.25;   // thickness of a slice
  double thin_m = 0.015;   // one point per cube of this size
  double min_dbh_m = 0.05;
  // Thinner stems are searched in the end, among what no other stem explains; 0: they are not. No
  // setting: see search_of.
  double thin_dbh_m = 0.0;
  // Standard deviation of the points about the stems of a blurred cloud; 0: it is sharp. No
  // setting: see add_blurred_stems.
  double blur_m = 0.0;
  double max_dbh_m = 1.2;
  int min_returns = 25;       // of the cloud on the stem's surface
  double min_arc_deg = 60.0;  // of the circle that points cover, over all slices
  int min_slices = 3;         // with a good circle
  double max_lean_deg = 25.0;
};
void describe(ConfigTable& table, StemDetectorConfig& config);

// A circle in one slice, as accepted.
struct StemSlice {
  float height_m = 0.0F;
  float x = 0.0F;
  float y = 0.0F;
  float radius_m = 0.0F;
  float rms_m = 0.0F;
  float arc_deg = 0.0F;
};

// A stem: a slowly tapering, leaning cone through the points around breast height.
struct StemFit {
  // Centre line at breast height (1.3 m), relative to the origin of the search; and its slope: what
  // x and y gain per metre of height.
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  double radius_m = 0.0;          // at breast height
  double section_radius_m = 0.0;  // with the sections there (radius_with_sections); 0: unknown
  double taper = 0.0;             // of the radius per metre of height (negative: thinner upwards)
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();       // of centre x, y and radius
  Eigen::Matrix2d foot_covariance = Eigen::Matrix2d::Zero();  // of the centre line at the ground
  double spread_m = 0.0;   // of the radius, if returns were independent; see diameter_sd_m
  double scatter_m = 0.0;  // of the points about the noisy cylinder's surface, in each direction
  // Beside it along the beams, see measure_at_breast_height; 0: it is part of the scatter.
  double range_noise_m = 0.0;
  double below_sd_m = 0.0;  // of the radius: how the taper may differ below what was seen
  double rms_m = 0.0;       // of the points on the surface
  bool in_foliage = false;  // a thin column that foliage surrounds; see foliage_columns.h
  double arc_deg = 0.0;     // covered by points
  // How its outline differs from a circle: metres that the second harmonic adds to the radius, as a
  // vector of twice its direction. NaN where it was not seen all round.
  Eigen::Vector2d oval = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  int returns = 0;        // of the cloud
  double lowest_m = 0.0;  // first and last height with points on the surface
  double highest_m = 0.0;
  BeamFootprint beam;          // of the beams that met it, where they are known
  double beam_excess_m = 0.0;  // what these added to the radius, and was taken away from it
  std::vector<StemSlice> slices;
};

// Where stems are wanted, in the frame of the points, and where that frame begins.
struct StemSearchArea {
  GroundArea area;
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
};

// Stems among the points of the slices. Points may be in any order, and come back sorted by place:
// there are too many for a second copy. The same points give the same stems for any number of
// threads; what is far away does not matter. Stems come sorted by x, then y. Polls `progress`.
// `blur_m` is told what add_blurred_stems gave.
[[nodiscard]] std::vector<StemFit> detect_stems(std::vector<SlicePoint>& points,
                                                const StemDetectorConfig& config,
                                                const StemSearchArea& where = {},
                                                const ProgressSink& progress = {},
                                                double* blur_m = nullptr);

// The searches of detect_stems, one after the other: thin slices, thick ones, thick stems of a
// blurred cloud, columns within foliage. The last one, for columns thinner than min_dbh_m, is to
// come after that for hidden stems. Each looks at the points that no known stem explains; that of a
// blurred cloud knows of none. Of a cloud in tiles it has to know those beyond the tile. Gives the
// stems with the centre in the area.
enum class StemCut { kThin, kThick, kBlurred, kFoliage, kThinnest };
[[nodiscard]] std::vector<StemFit> detect_stems_in_cut(StemCut cut, std::vector<SlicePoint>& points,
                                                       const std::vector<StemFit>& known,
                                                       const StemDetectorConfig& config,
                                                       const StemSearchArea& where,
                                                       const ProgressSink& progress);
// Metres above the ground.
struct HeightRange {
  double lowest_m = 0.0;
  double highest_m = 0.0;
};
// The heights of the searches for stems whose foot is hidden, one after the other. Each lies 1 m
// and more above lowest_m.
[[nodiscard]] std::vector<HeightRange> hidden_stem_heights(const StemDetectorConfig& config);
// Stems among points of such heights that none of the known ones explains. Only columns that stand
// clear or alone count. Their diameter at breast height follows from the usual taper, and its
// covariance holds what tapers may differ. Gives the stems with the centre in the area.
[[nodiscard]] std::vector<StemFit> detect_hidden_stems(
    const HeightRange& heights, std::vector<SlicePoint>& points, const std::vector<StemFit>& known,
    const StemDetectorConfig& config, const StemSearchArea& where, const ProgressSink& progress);
// m around the area: points so far away may matter, and stems known of the first cut.
[[nodiscard]] double stem_search_reach(const StemDetectorConfig& config);
// By x, then y of the centre.
void sort_by_place(std::vector<StemFit>& stems);

}  // namespace understory
