#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/sensor/scan.h"
#include "understory/sensor/stem_view.h"

namespace understory {

// Which stems of a frame are given.
struct StemSegmentConfig {
  // Which way is up in the frame of the points, within 25 degrees; what the stems themselves say
  // replaces it. The rings must be about level, the lidar may hang upside down.
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  double max_range_m = 45.0;  // farther returns are passed over
  double min_score = 0.5;     // segments that are less probably stems are left out
};

// A stem, or the part of it that was seen: a straight piece of centre line with its radius.
struct StemSegment {
  // Where the centre line meets the ground, as far as the frame shows the ground there; else the
  // lowest point that was seen of it. Metres, frame of the points.
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();
  bool foot_on_ground = false;
  double foot_sd_m = 1.0;                           // of its height
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  // unit, upwards
  double lowest_m = 0.0;   // along the axis from the foot: where it was first ...
  double highest_m = 0.0;  // ... and last seen
  double radius_m = 0.0;   // best guess, from its own width and those of the others
  double radius_sd_m = 0.0;
  // From its own width 0.5 to 2.3 m above the ground. 0 where it was not seen whole there, or where
  // fewer than three returns fall on it: it then looks thin.
  double dbh_m = 0.0;
  double dbh_sd_m = 0.0;
  double score = 0.0;     // probability that this is a stem, 0..1
  int levels = 0;         // rings or slices that got it
  int levels_with_3 = 0;  // of these with three returns or more
  int returns = 0;
  std::uint32_t t_ns = 0;  // mean time of its returns since the frame's stamp
  // Of the foot's x and y and of the axis' slope in x and y, in the level frame. Its z is up, and
  // it is turned as little as possible against the frame of the points. Of a lidar that hangs
  // upside down, half a turn about its x axis comes first. Not aligned to more than malloc gives:
  // std::stable_sort's buffer is not either.
  Eigen::Matrix<double, 4, 4, Eigen::DontAlign> covariance = Eigen::Matrix4d::Zero();
  std::array<double, 15> traits{};  // what the score was made from (stem_score.h)
};

// What was found in one frame, and the measures that the detector took of it.
struct StemSegments {
  std::vector<StemSegment> stems;                 // nearest first
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // in the frame of the points, from the stems
  int levels = 0;                                 // rings or slices
  double step = 0.0;            // between neighbouring returns: radians, of a cloud metres
  double range_sd_m = 0.0;      // noise along the beam
  double usual_radius_m = 0.0;  // median of the stems
};

// Upright stems in one frame of a spinning lidar with any number of rings, in the frame of the
// lidar. The motion within the scan is not taken out: a stem is seen in a millisecond, and its
// `t_ns` says when. Takes the spacing of returns and the noise from the frame itself; no parameter
// of the site.
//
// Each ring is cut into narrow runs of returns with a step in depth at both sides. Runs of
// different rings that lie on one upright line are gathered into segments by a sequential
// least-squares fit. The fit also counts the beams that passed the line where the stem should have
// stopped them. The surface that the beams hit lies in front of the centre by pi/4 of the radius in
// the mean over the width (P1 figure 11). The radius comes from the widths of all runs together.
//
// `use` has an entry a point of the scan; empty: all are used. 0 is what is on the machine that
// carries the lidar: it hides what lies behind and is never a stem.
//
// Empty for a frame without rings. Deterministic; thread-safe. P1 section 2.3 and figure 11.
[[nodiscard]] StemSegments find_stem_segments(const Scan& scan, const StemSegmentConfig& config,
                                              const std::vector<std::uint8_t>& use = {});

// How many of the stems stand on ground that shows, each by its score and by how well the ground is
// known at its foot. The same scan upside down has less than two thirds of it: crowns are no
// ground.
[[nodiscard]] double standing_stems(const StemSegments& found);

// A segment as a row of a view, in the body's frame. Its covariance leaves out what the height has
// in common with the place. Diameters with a greater error than 2.5 cm are left out.
[[nodiscard]] Stem stem_of(const StemSegment& segment, const Pose& body_from_points,
                           const Eigen::Vector3d& up_in_points);

}  // namespace understory
