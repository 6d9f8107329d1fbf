#include <string>
#include <vector>

#include "fuzz_file.h"
#include "understory/preprocess/machine_boxes.h"
#include "understory/recording/extrinsics.h"
#include "understory/util/config/config.h"
#include "understory/util/error.h"

namespace {

using namespace understory;

// Configurations and sites are read by one table of this kind each.
struct Sample {
  double voxel_size_m = 0.5;
  int count = 3;
  bool enabled = true;
  std::string name = "a";
  std::vector<double> gains = {1.0, 2.0};
  enum class Method { kFast, kExact } method = Method::kFast;
};

void read_table(const std::string& path, const std::string& text) {
  Sample sample;
  ConfigTable table;
  table.section("map", [&] {
    table.add("voxel_size_m", sample.voxel_size_m, {0.05, 10.0}, "m", "edge of a voxel");
    table.add("count", sample.count, {1, 100}, "", "how many");
    table.section("deep", [&] { table.add("gains", sample.gains, "", "gains"); });
  });
  table.add("enabled", sample.enabled, "whether");
  table.add("name", sample.name, "a name");
  table.add_enum("method", sample.method,
                 {{"fast", Sample::Method::kFast}, {"exact", Sample::Method::kExact}}, "which");
  std::vector<std::string> passed_over;
  try {
    table.read_yaml(text, "fuzz", &passed_over);
  } catch (const ConfigError&) {
  }
  table.read_file(path);
  // What was read is written so that it is read again.
  table.read_yaml(table.to_yaml(true), "again");
}

void read_as(std::uint8_t kind, const std::string& path, const std::string& text) {
  Log log;
  Rig rig;
  rig.body_frame = kind % 2 == 0 ? "imu" : "lidar";
  rig.body_from_imu = Pose();
  switch (kind % 8) {
    case 0:
    case 1:
      apply_extrinsics_file(path, {"os_imu"}, rig, log);
      break;
    case 2:
    case 3:
      (void)read_machine_boxes(path);
      break;
    default:
      read_table(path, text);
  }
}

}  // namespace

// The first byte says what the rest is read as.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const FuzzFile file(data + 1, size - 1);
  try {
    read_as(data[0], file.path(), std::string(reinterpret_cast<const char*>(data + 1), size - 1));
  } catch (const InputError&) {
  } catch (const ConfigError&) {
  }
  return 0;
}
