// Diameters of the stems of simulated clouds beside their truth. The clouds are searched once, and
// their stems kept, so that a change of the fit is measured on thousands of stems within seconds.
//   stem_sizes gather SENSOR TRUTH FILE       stems of TRUTH/points.laz and the points around them
//   stem_sizes gather SENSOR TRUTH FILE RUN   the same of RUN/map.laz, by the run's own path
//   stem_sizes fit FILE [FILE ...]            fits them; prints a table (CSV), a row for each stem
// TRUTH is the folder of `understory simulate --set truth.points=true`, SENSOR a name of the
// setting beam.sensor ("unknown": no footprints). RUN is of `understory map`; the
// true trees are laid on its list. Stems within 30 m of the true
// path are taken that stand within 0.5 m of a true tree. benchmarks/stem_sizes.py fits the
// constants of diameter_sd_m and of excess_radius_m.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/evaluation/trees/tree_errors.h"
#include "understory/forest/ground/ground.h"
#include "understory/forest/slice/slice_thinner.h"
#include "understory/forest/stems/beam_footprint.h"
#include "understory/forest/stems/range_noise.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/stems/stem_detector.h"
#include "understory/forest/stems/stem_fit.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/util/error.h"
#include "understory/util/log.h"

namespace understory {
namespace {

constexpr double kFarthest = 30.0;
constexpr double kSameM = 0.5;
constexpr double kReach = 0.35;  // around the surface, as the detector takes

const std::map<std::string, LidarSensor> kSensors = {{"unknown", LidarSensor::kUnknown},
                                                     {"OS0", LidarSensor::kOs0},
                                                     {"OS1", LidarSensor::kOs1},
                                                     {"VLP-16", LidarSensor::kVlp16},
                                                     {"VLP-32C", LidarSensor::kVlp32}};

// A stem as it is kept; its points follow.
struct Kept {
  std::int32_t sensor = 0;
  std::uint32_t points = 0;
  double path_m = kFarthest;  // from the true path
  double range_m = 0.0;       // see mean_range_to
  double true_dbh_m = 0.0;
  double start[6] = {};  // centre, slope, radius, taper
};

PointBlocks blocks_of_cloud(const PointCloudFile& cloud) {
  return [&cloud](const PointVisitor& visit) {
    std::vector<Eigen::Vector3d> block;
    for (const Eigen::Vector3f& point : cloud.points) {
      block.push_back(cloud.origin + point.cast<double>());
      if (block.size() < 65'536) continue;
      visit(block);
      block.clear();
    }
    visit(block);
  };
}

std::vector<SlicePoint> slices_of(const PointCloudFile& cloud, const GroundModel& ground,
                                  const StemDetectorConfig& config) {
  SliceThinner thinner(config.thin_m);
  std::vector<double> heights;
  blocks_of_cloud(cloud)([&](std::span<const Eigen::Vector3d> points) {
    ground.heights_above(points, heights);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!(heights[i] >= config.lowest_m && heights[i] < config.highest_m)) continue;
      const Eigen::Vector3d place = points[i] - cloud.origin;
      thinner.add(place.x(), place.y(), heights[i]);
    }
  });
  return thinner.take();
}

// What is known of a stem; no true diameter where it is none of the trees.
Kept describe_stem(const StemFit& stem, const Eigen::Vector3d& breast,
                   const std::vector<Eigen::Vector3d>& scanner, const std::vector<Tree>& trees) {
  Kept kept;
  const Eigen::Vector2d foot = breast.head<2>() - kBreastHeight * stem.slope;
  double nearest = kSameM;
  for (const Tree& tree : trees) {
    const double gap = std::hypot(tree.x - foot.x(), tree.y - foot.y());
    if (gap >= nearest) continue;
    nearest = gap;
    kept.true_dbh_m = tree.dbh_m;
  }
  for (const Eigen::Vector3d& place : scanner)
    kept.path_m = std::min(kept.path_m, (place - breast).head<2>().norm());
  kept.range_m = mean_range_to(scanner, breast);
  const double start[6] = {stem.centre.x(), stem.centre.y(), stem.slope.x(),
                           stem.slope.y(),  stem.radius_m,   stem.taper};
  std::copy(std::begin(start), std::end(start), std::begin(kept.start));
  return kept;
}

// A cloud, its scanner's path and the true trees, all in one frame.
struct KnownCloud {
  PointCloudFile cloud;
  std::vector<Tree> trees;
  std::vector<Eigen::Vector3d> scanner;
};

// `run`: empty for the cloud of the truth.
KnownCloud read_known_cloud(const std::string& truth, const std::string& run) {
  Log log;
  KnownCloud known;
  known.cloud = read_cloud(run.empty() ? truth + "/points.laz" : run + "/map.laz", log);
  known.trees = read_trees(truth + "/trees.csv");
  if (!run.empty()) {
    const LayerFrame layers = read_layer_frame(run);
    const Eigen::Vector3d origin = known.cloud.origin;
    known.cloud.origin = layers.to_world(origin);
    for (Eigen::Vector3f& point : known.cloud.points)
      point = (layers.to_world(origin + point.cast<double>()) - known.cloud.origin).cast<float>();
    const auto run_from_truth =
        align_trees(known.trees, read_trees(run + "/trees.csv"), Alignment::kYaw, kSameM);
    if (!run_from_truth) throw InputError(run, "", "expected trees that match those of the truth");
    known.trees = moved(known.trees, *run_from_truth);
  }
  for (const auto& pose : read_trajectory((run.empty() ? truth : run) + "/trajectory.tum"))
    known.scanner.push_back(pose.world_from_body.translation());
  return known;
}

void gather(LidarSensor sensor, const std::string& truth, const std::string& out,
            const std::string& run) {
  const auto [cloud, trees, scanner] = read_known_cloud(truth, run);
  const GroundModel ground = estimate_ground(blocks_of_cloud(cloud), {});
  const StemDetectorConfig config;
  std::vector<SlicePoint> points = slices_of(cloud, ground, config);
  std::ofstream file(out, std::ios::binary);
  for (const StemFit& stem : detect_stems(points, config)) {
    Eigen::Vector3d breast = cloud.origin;
    breast.head<2>() += stem.centre;
    breast.z() = ground.terrain.interpolate(breast.x(), breast.y()) + kBreastHeight;
    Kept kept = describe_stem(stem, breast, scanner, trees);
    if (kept.true_dbh_m == 0.0 || kept.path_m >= kFarthest) continue;
    std::vector<SlicePoint> near;
    const StemAxis axis(stem);
    for (const SlicePoint& point : points)
      if (axis.may_be_within(point, stem.radius_m + kReach)) near.push_back(point);
    kept.sensor = static_cast<std::int32_t>(sensor);
    kept.points = static_cast<std::uint32_t>(near.size());
    file.write(reinterpret_cast<const char*>(&kept), sizeof kept);
    file.write(reinterpret_cast<const char*>(near.data()),
               static_cast<std::streamsize>(near.size() * sizeof(SlicePoint)));
  }
}

struct FittedStem {
  Kept kept;
  StemFitResult fit;
  std::vector<SlicePoint> near;
};

std::vector<FittedStem> fitted_stems(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const StemDetectorConfig config;
  std::vector<FittedStem> stems;
  Kept kept;
  while (file.read(reinterpret_cast<char*>(&kept), sizeof kept)) {
    std::vector<SlicePoint> near(kept.points);
    file.read(reinterpret_cast<char*>(near.data()),
              static_cast<std::streamsize>(near.size() * sizeof(SlicePoint)));
    StemFit start;
    start.centre = {kept.start[0], kept.start[1]};
    start.slope = {kept.start[2], kept.start[3]};
    start.radius_m = kept.start[4];
    start.taper = kept.start[5];
    const StemFitResult first = fit_stem(near, start, config);
    if (!first.converged) continue;
    StemFitResult last = refine_stem(near, first, config);
    if (!last.converged) continue;
    stems.push_back({kept, std::move(last), std::move(near)});
  }
  return stems;
}

// Measures them as an inventory does, and gives the noise along the beams.
double measure(std::vector<FittedStem>& stems) {
  std::vector<StemFit> all;
  for (const FittedStem& stem : stems)
    all.push_back(stem.fit.stem);
  std::vector<RangeNoiseFits> told;
  for (const std::size_t i : stems_for_range_noise(all)) {
    if (const auto fits = fit_range_noise(stems[i].near, all[i])) told.push_back(*fits);
  }
  const double noise = range_noise_of(told);
  for (FittedStem& stem : stems) {
    measure_at_breast_height(stem.near, noise, stem.fit.stem);
    stem.fit.stem.radius_m = stem.fit.stem.section_radius_m;
  }
  return noise;
}

void fit(const std::string& path) {
  std::vector<FittedStem> stems = fitted_stems(path);
  const double noise = measure(stems);
  for (const auto& [kept, last, near] : stems) {
    const StemFit& stem = last.stem;
    BeamConfig beams;
    beams.sensor = static_cast<LidarSensor>(kept.sensor);
    const BeamFootprint beam = footprint_at(beams, kept.range_m);
    const double excess = excess_radius_m(beam, stem.radius_m, stem.arc_deg);
    std::printf("%s,%d,%.3f,%.3f,%.5f,%.5f,%.5f,%.6f,%.1f,%d,%.5f,%.4f,%.5f,%.5f,%.5f\n",
                std::filesystem::path(path).stem().c_str(), kept.sensor, kept.path_m, kept.range_m,
                kept.true_dbh_m, 2.0 * stem.radius_m, 2.0 * excess, stem.spread_m, stem.arc_deg,
                stem.returns, stem.scatter_m, beam.signal > 0.0 ? 1.0 / beam.signal : 0.0,
                beam.sd_m, excess_width_m(beam, stem.radius_m), noise);
  }
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  using namespace understory;
  const std::string mode = argc > 2 ? argv[1] : "";
  if (mode == "gather" && (argc == 5 || argc == 6) && kSensors.count(argv[2]) > 0) {
    gather(kSensors.at(argv[2]), argv[3], argv[4], argc == 6 ? argv[5] : "");
  } else if (mode == "fit") {
    std::printf(
        "cloud,sensor,path_m,range_m,true_m,dbh_m,excess_m,spread_m,arc_deg,returns,scatter_m,"
        "weakness,beam_m,width_m,noise_m\n");
    for (int i = 2; i < argc; ++i)
      fit(argv[i]);
  } else {
    std::fprintf(stderr, "stem_sizes gather SENSOR TRUTH FILE [RUN] | stem_sizes fit FILE ...\n");
    return 2;
  }
  return 0;
}
