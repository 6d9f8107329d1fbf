// One pair of scans by PCL's NDT, as a line of JSON:
//   pcl_ndt A.bin B.bin VOXEL_M CELL_M ROUNDS
// Scans: x y z intensity, float32. The guess is no motion. Times are CPU, the least of the rounds.
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/registration/ndt.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

static double cpu_ms() {
  return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

static Cloud::Ptr read_scan(const char* path) {
  Cloud::Ptr cloud(new Cloud);
  std::ifstream file(path, std::ios::binary);
  float row[4];
  while (file.read(reinterpret_cast<char*>(row), sizeof row))
    cloud->push_back({row[0], row[1], row[2]});
  return cloud;
}

static Cloud::Ptr thinned(const Cloud::Ptr& cloud, float edge) {
  pcl::VoxelGrid<pcl::PointXYZ> grid;
  grid.setInputCloud(cloud);
  grid.setLeafSize(edge, edge, edge);
  Cloud::Ptr thin(new Cloud);
  grid.filter(*thin);
  return thin;
}

int main(int argc, char** argv) {
  if (argc < 6) {
    std::fprintf(stderr, "usage: pcl_ndt A.bin B.bin VOXEL_M CELL_M ROUNDS\n");
    return 2;
  }
  const Cloud::Ptr target = read_scan(argv[1]);
  const Cloud::Ptr source = read_scan(argv[2]);
  const float edge = static_cast<float>(std::atof(argv[3]));
  double prepare = 1e9;
  double align = 1e9;
  Eigen::Matrix4f pose = Eigen::Matrix4f::Identity();
  int iterations = 0;
  for (int round = 0; round < std::atoi(argv[5]); ++round) {
    double start = cpu_ms();
    const Cloud::Ptr a = thinned(target, edge);
    const Cloud::Ptr b = thinned(source, edge);
    pcl::NormalDistributionsTransform<pcl::PointXYZ, pcl::PointXYZ> ndt;
    ndt.setResolution(static_cast<float>(std::atof(argv[4])));
    ndt.setTransformationEpsilon(1e-3);
    ndt.setMaximumIterations(50);
    ndt.setInputTarget(a);
    ndt.setInputSource(b);
    prepare = std::min(prepare, cpu_ms() - start);
    start = cpu_ms();
    Cloud out;
    ndt.align(out);
    align = std::min(align, cpu_ms() - start);
    pose = ndt.getFinalTransformation();
    iterations = ndt.getFinalNumIteration();
  }
  std::printf(
      "{\"prepare_ms\": %.2f, \"align_ms\": %.2f, \"iterations\": %d, \"translation_m\": [%.4f, "
      "%.4f, "
      "%.4f]}\n",
      prepare, align, iterations, pose(0, 3), pose(1, 3), pose(2, 3));
  return 0;
}
