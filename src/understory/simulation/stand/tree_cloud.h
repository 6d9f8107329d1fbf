#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace understory {

// A scanned tree as small discs, its foot at zero: the middle of the stem where the cloud begins.
struct TreeCloud {
  struct Disc {
    Eigen::Vector3f centre = Eigen::Vector3f::Zero();
    Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();
    float radius_m = 0.0F;
  };
  std::vector<Disc> stem;
  std::vector<Disc> crown;  // all else
  double height_m = 0.0;
  Eigen::Vector2d lean = Eigen::Vector2d::Zero();  // of the lowest 3 m, metres a metre of height
};

// Reads the cloud of one tree alone (.las, .laz, .pcd, .ply; metres, z up) and makes a disc of each
// point. Its normal is that of the plane through the ten nearest points, and its radius reaches to
// the fourth. Points nearer than 7 mm to one that was taken are left out. The stem is followed
// upwards from its foot in slices of a quarter of a metre; dbh_m is that of the tree in the file.
// Throws InputError if the file cannot be read or holds no tree (fewer than 100 points, lower than
// 1.5 m).
[[nodiscard]] TreeCloud read_tree_cloud(const std::string& path, double dbh_m);

}  // namespace understory
