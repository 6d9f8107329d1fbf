#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "understory/forest/dead_wood/dead_wood.h"
#include "understory/forest/form/stem_curve.h"
#include "understory/forest/trees/tree_fall.h"
#include "understory/geometry/stamped_pose.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/stem_view.h"
#include "understory/sensor/tree.h"
#include "understory/util/files/atomic_file.h"

namespace understory {

// The tables of a run folder (docs/reference/outputs.md). Each writer takes rows in order and makes
// the file appear with `commit`; memory does not grow with the rows. OutputError where it cannot be
// written.

// trajectory.tum, keyframes.tum: `timestamp_s x y z qx qy qz qw`, nine decimals, w not negative.
class TumWriter {
 public:
  explicit TumWriter(const std::filesystem::path& path);
  // Returns the pose as a reader of the file gets it.
  StampedPose add(const StampedPose& pose);
  void commit() { file_.commit(); }

 private:
  AtomicTextFile file_;
};

// What states.csv.gz says of one scan beside its pose.
struct StateRow {
  TimeNs stamp = 0;
  Eigen::Vector3d velocity_in_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();
  Matrix6d pose_covariance = Matrix6d::Zero();  // right perturbation, rotation first, body frame
};

// Writes states.csv.gz, one row a positioned scan. The file appears whole at `commit` or not at
// all.
class StatesWriter {
 public:
  explicit StatesWriter(const std::filesystem::path& path);
  void add(const StateRow& row);
  void commit() { file_.commit(); }

 private:
  AtomicTextFile file_;
};

// One GNSS fix and what became of it. Residual: fix minus antenna position, world frame.
struct GnssRow {
  GnssFix fix;
  Eigen::Vector3d position_in_world =
      Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  Eigen::Vector3d residual = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  bool used = false;
  std::string reason;  // why not used
};

// Writes gnss.csv, one row a fix. The file appears whole at `commit` or not at all.
class GnssWriter {
 public:
  explicit GnssWriter(const std::filesystem::path& path);
  void add(const GnssRow& row);
  void commit() { file_.commit(); }

 private:
  AtomicTextFile file_;
};

// The pose graph of the keyframes.
struct GraphVertex {
  int id = 0;
  Pose world_from_body;
  bool fixed = false;
};
struct GraphEdge {
  int from = 0;
  int to = 0;
  Pose from_from_to;                            // pose of `to` in the frame of `from`
  Matrix6d information = Matrix6d::Identity();  // right perturbation, rotation first
};

// graph.g2o: VERTEX_SE3:QUAT, FIX, EDGE_SE3:QUAT. g2o's error is (translation, quaternion vector
// part), so information about the rotation vector is multiplied by the derivative (half angle).
void write_g2o(const std::filesystem::path& path, const std::vector<GraphVertex>& vertices,
               const std::vector<GraphEdge>& edges);
// Information of a right perturbation (rotation, translation) as g2o's (translation, quaternion).
[[nodiscard]] Matrix6d g2o_information(const Matrix6d& information);

// trees.csv with the columns of docs/reference/outputs.md; empty where unknown.
void write_trees_csv(const std::filesystem::path& path, const std::vector<Tree>& trees);

// stem_curves.csv: `tree_id,height_m,x,y,diameter_m,diameter_sd_m,measured`, upwards. `curves` have
// the order of `trees`; their centres are relative to `origin`.
void write_stem_curves(const std::filesystem::path& path, const std::vector<Tree>& trees,
                       const std::vector<StemCurve>& curves, const Eigen::Vector2d& origin);

// dead_wood.csv: `id,kind,x,y,z,x_to,y_to,z_to,diameter_m,diameter_to_m,diameter_sd_m,length_m,
// volume_m3,observations`; lengths of stumps are their heights.
void write_dead_wood(const std::filesystem::path& path, const std::vector<DeadWood>& pieces);

// felled.csv: `id,x,y,seen_until,gone_since,missed`.
void write_tree_falls(const std::filesystem::path& path, const std::vector<TreeFall>& falls);

// One stem seen in one frame, for stems.csv.gz: body frame; NaN is written as empty.
class StemsWriter {
 public:
  explicit StemsWriter(const std::filesystem::path& path);
  // Returns the stem as a reader of the file gets it.
  Stem add(int frame, TimeNs stamp, const Stem& stem);
  void commit() { file_.commit(); }

 private:
  AtomicTextFile file_;
};

}  // namespace understory
