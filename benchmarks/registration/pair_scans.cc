// Scans of a simulated site for benchmarks of registration, without the motion within a scan:
//   pair_scans SITE SEED COUNT FOLDER [key=value ...]
// writes COUNT scans, evenly spread over the recording, as FOLDER/scan_N.bin (x y z intensity).
// Their poses, world from lidar, go to FOLDER/poses.txt (12 numbers a line, row by row).
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "understory/features/test_frames.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"
#include "understory/util/time.h"

namespace understory {
namespace {

void write_scan(const std::string& path, const Scan& scan, const TestFrames& site,
                const Pose& lidar_from_world) {
  std::ofstream file(path, std::ios::binary);
  for (const ScanPoint& point : scan.points) {
    const Pose still = lidar_from_world * site.world_from_lidar(scan, 1e-9 * point.t_ns);
    const Eigen::Vector3f at = (still * Eigen::Vector3d(point.x, point.y, point.z)).cast<float>();
    const float row[4] = {at.x(), at.y(), at.z(), point.intensity};
    file.write(reinterpret_cast<const char*>(row), sizeof row);
  }
}

void run(const SiteConfig& config, int count, const std::string& folder) {
  TestFrames site(config);
  std::filesystem::create_directories(folder);
  std::ofstream poses(folder + "/poses.txt");
  poses.precision(9);
  std::int64_t last = 0;
  while (to_seconds(site.scanner.end(last)) < site.duration_s())
    ++last;
  for (int i = 0; i < count; ++i) {
    const std::int64_t k = (2 * i + 1) * last / (2 * count);
    const SimulatedScan frame = site.scanner.cast(k);
    const Pose world_from_lidar = site.world_from_lidar(*frame.scan, 0.05);
    char name[32];
    std::snprintf(name, sizeof name, "/scan_%03d.bin", i);
    write_scan(folder + name, *frame.scan, site, world_from_lidar.inverse());
    const Eigen::Matrix4d m = world_from_lidar.matrix();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c)
        poses << m(r, c) << (r == 2 && c == 3 ? '\n' : ' ');
    }
  }
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  if (argc < 5) {
    std::fprintf(stderr, "usage: pair_scans SITE SEED COUNT FOLDER [key=value ...]\n");
    return 2;
  }
  try {
    std::vector<std::string> settings = {std::string("seed=") + argv[2]};
    settings.insert(settings.end(), argv + 5, argv + argc);
    understory::with_threads(1, [&] {
      understory::run(understory::load_site(argv[1], settings), std::max(1, std::atoi(argv[3])),
                      argv[4]);
    });
  } catch (const understory::Error& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 3;
  }
  return 0;
}
