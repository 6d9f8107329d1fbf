#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/preprocess/body_cloud.h"
#include "understory/preprocess/range_grid.h"
#include "understory/sensor/scan.h"
#include "understory/util/config/config.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// What is weather: flakes, snow off branches, and spurious ranges of a cold lidar and of the low
// sun. P3 shows it in figure 6 II and the lessons below it.
struct WeatherFilterConfig {
  bool enabled = false;
  // Where there is weather, a return is one where its distance from others, as a share of its
  // range, is above this times its brightness.
  double apart = 0.111;
  double reach = 0.05;  // share of its range beyond which a return is alone
  int scans = 3;        // before this one, in which what stands still must have been seen
};
void describe(ConfigTable& table, WeatherFilterConfig& config);

// Takes returns out of a scan that are dark and stand alone, in their scan and in those before it.
// A wall, a stem or the ground is in the scan before too; a flake is not.
//   s  cbrt(d1^2 d2) in the same scan. The nearest return is d1 away and the second nearest d2, as
//      shares of 0.1 m + range and at most `reach`.
//   b  the same in the scans before.
//   i  intensity over that of the bright returns: nine of ten are darker.
//   w  weight by the share of the returns around that stand alone (LoneShare), at most 1. It falls
//      again where the weather is so thick that good returns stand alone, too.
// A return goes where sqrt(s b) w (range / 10 m)^0.18 > apart (i + 0.02). It must be 1.32 times as
// far where a neighbour on its ring goes on with it. Bright returns thus never go. What goes along
// with the lidar is looked up where it is, seen from there. Without intensities (all the same)
// nothing goes. One scan after another; not thread-safe, parallel inside, the same result for any
// number of threads. The constants are ours (preprocess_constants.h): P3 names no filter.
class WeatherFilter {
 public:
  explicit WeatherFilter(const WeatherFilterConfig& config) : config_(config) {}

  // `world_from_body`: at the cloud's stamp, as predicted. Returns how many went. Nothing without
  // `enabled`. Before the first scan only the scan itself tells.
  std::size_t drop(BodyCloud& cloud, const Pose& world_from_body);
  // The cloud that `drop` saw last has this pose: it is one of the scans before from now on.
  void remember(const Pose& world_from_body);
  // Whether it judges the returns of a scan: it is enabled, and they have intensities.
  [[nodiscard]] bool judges(const Scan& scan) const;
  // The world was moved (loop closure).
  void move_world(const Pose& new_world_from_old_world);
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  struct Seen {
    Pose world_from_body;
    Points points;  // all that the scan had
    std::vector<float> range;
    RangeGrid grid;
  };
  // What the returns are before those around them are asked, one entry each.
  struct Lone {
    std::vector<float> excess;  // sqrt(s b) over the least that is weather amid weather; 0: below 1
    std::vector<std::uint8_t> alone;  // 1: nothing near it in any scan
  };
  void look(const BodyCloud& cloud);
  [[nodiscard]] Lone find_lone(const BodyCloud& cloud, float bright,
                               const std::vector<Eigen::Isometry3f>& past_from_body) const;
  [[nodiscard]] std::vector<std::uint8_t> judge(const BodyCloud& cloud,
                                                const Pose& world_from_body) const;

  WeatherFilterConfig config_;
  Seen now_;  // of the last `drop`
  std::deque<Seen> before_;
};

}  // namespace understory
