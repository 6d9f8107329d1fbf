#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/feature_points.h"
#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/registration/registration.h"

// The seam between those who match scans (odometry, loops, the command `register`) and the methods
// that do it. They know only what is here; which methods there are is told by matchers.h.
namespace understory {

// How good the guess is.
enum class MatchStart {
  kFar,   // off by more than the target's reach: search from coarse to fine
  kNear,  // within its reach: the fine steps alone
};

// The cost that a match of a source makes small, of the points alone. For those who make it small
// together with terms of their own, such as the elastic scans of odometry. Immutable, thread-safe;
// lives no longer than its source and its target.
class MatchCost {
 public:
  virtual ~MatchCost() = default;
  // At a pose, in the scale in which Gaussian terms can be added; the Hessian is positive
  // semidefinite. Parallel; same bits for any number of threads.
  [[nodiscard]] virtual PoseCost at(const Pose& target_from_source) const = 0;
  // Steps shorter than both change nothing that counts.
  [[nodiscard]] virtual double step_translation_m() const = 0;
  [[nodiscard]] virtual double step_rotation_rad() const = 0;
};

// What a matcher made of a set of clouds, e.g. the local map's keyframes. Immutable for all who
// hold it, and shared between threads.
class MatchTarget {
 public:
  virtual ~MatchTarget() = default;

  // Matches points, best thinned by a voxel filter, from a guess of target_from_source. `terms`
  // count beside the points; the information of the result is that of the points alone. Parallel;
  // same bits for any number of threads.
  [[nodiscard]] virtual RegistrationResult match(const Points& source, const Pose& guess,
                                                 const PoseTerms& terms,
                                                 MatchStart start) const = 0;
  // The same of points with features (Matcher::feature_finder). Methods without features take all
  // points alike; those with features find nothing in points that have none.
  [[nodiscard]] virtual RegistrationResult match_features(const FeaturePoints& source,
                                                          const Pose& guess, const PoseTerms& terms,
                                                          MatchStart start) const {
    return match(source.points, guess, terms, start);
  }
  // A point farther than about this from all that the target shows matches nothing, metres. If
  // points lay there by chance, they would be half of it (RMS) from what they match.
  [[nodiscard]] virtual double reach_m() const = 0;
  // Points, or cells of a method that sums up points, that the finest steps match to.
  [[nodiscard]] virtual std::size_t size() const = 0;
  // The cost of a source in the coarsest (kFar) or in the last (kNear) steps. Null if the method
  // makes no cost small that can be told at a pose.
  [[nodiscard]] virtual std::unique_ptr<const MatchCost> cost(const Points& source,
                                                              MatchStart start) const {
    static_cast<void>(source);
    static_cast<void>(start);
    return nullptr;
  }
  [[nodiscard]] virtual std::unique_ptr<const MatchCost> cost_of_features(
      const FeaturePoints& source, MatchStart start) const {
    return cost(source.points, start);
  }
};
using MatchTargetPtr = std::shared_ptr<const MatchTarget>;

// Makes targets of clouds that come one after another. Not thread-safe itself; works in parallel
// inside, with the same bits for any number of threads.
class TargetBuilder {
 public:
  virtual ~TargetBuilder() = default;

  // Adds a cloud. Then, if given, forgets what is farther than `forget_beyond_m` from its origin.
  virtual void insert(const Points& points_in_source, const Pose& target_from_source,
                      std::optional<double> forget_beyond_m) = 0;
  virtual void insert_features(const FeaturePoints& points_in_source,
                               const Pose& target_from_source,
                               std::optional<double> forget_beyond_m) {
    insert(points_in_source.points, target_from_source, forget_beyond_m);
  }
  // Forgets what is farther than `radius_m` from a place (frame of the target).
  virtual void forget_beyond(const Eigen::Vector3d& centre, double radius_m) = 0;
  virtual void clear() = 0;
  // Bytes that it and its last snapshot take, about. They follow from how much both hold, so that
  // all machines agree after the same clouds.
  [[nodiscard]] virtual double bytes() const = 0;
  // The target as it is now. Quickest if nobody holds the last one any more: its memory may then be
  // written on.
  [[nodiscard]] virtual MatchTargetPtr snapshot() = 0;
};

// How the clouds of a target and those matched to it were seen.
struct Viewpoint {
  // Where the lidar is in the frames of the sources, metres; unknown: nothing.
  std::optional<Eigen::Vector3d> lidar_in_source;
  // Where lidars 1, 2 ... of a scan of several are, metres (FeaturePoints::lidars).
  std::vector<Eigen::Vector3d> further_lidars_in_source = {};
};

// A whole scan with its rings: parallel arrays in the order in which it was measured. Axes with z
// about upwards; the lidar near their origin.
struct RingPoints {
  const Points* points = nullptr;
  const std::vector<std::uint16_t>* ring = nullptr;
};

// Finds what the rings of a scan tell of its points. Immutable, thread-safe.
class FeatureFinder {
 public:
  virtual ~FeatureFinder() = default;
  // Of each point. Throws InputError for a scan of one ring or without rings.
  [[nodiscard]] virtual std::vector<PointFeature> find(const RingPoints& scan) const = 0;
};

// A method with its settings. Immutable, thread-safe.
class Matcher {
 public:
  virtual ~Matcher() = default;

  [[nodiscard]] virtual std::unique_ptr<TargetBuilder> make_builder(
      const Viewpoint& viewpoint) const = 0;
  // Of a single cloud, in its own frame.
  [[nodiscard]] virtual MatchTargetPtr make_target(const Points& points) const;
  // Of a method that matches features alone; null: it matches points.
  [[nodiscard]] virtual std::shared_ptr<const FeatureFinder> feature_finder() const {
    return nullptr;
  }
  // See MatchTarget::reach_m; of all its targets.
  [[nodiscard]] virtual double reach_m() const = 0;
  // Whether the method sums up the points of a target, so that many tell more than few. If not, it
  // looks for single points: best is a target that is thinned like the source.
  [[nodiscard]] virtual bool sums_up_points() const = 0;
};

// How the error of a method's matches grows with their fitness, P4 (36). Found on simulated
// recordings, see docs/method/odometry.md.
struct FitnessNoise {
  double threshold_m2 = 0.0;  // tau: up to this fitness a match is as good as any
  double scale = 0.0;         // theta, 1/m^4: growth of the deviation with the square of the excess
};

// What is known of a recording's scans when the settings of a method are chosen for it.
struct ScanTraits {
  bool sparse = false;  // a lidar of few rings: few points, and most of them in traces of rings
  bool alone = false;   // no IMU: guesses are often off by more than the finest reach
};

// One setting of a method that suits such scans: key below the method's section, value as YAML.
struct SuitedSetting {
  std::string key;
  std::string value;
};

}  // namespace understory
