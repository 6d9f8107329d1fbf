#include <fstream>
#include <string>

#include "fuzz_folder.h"
#include "understory/odometry/dense_odometry.h"
#include "understory/odometry/stem_pacer.h"
#include "understory/pipeline/checkpoint.h"
#include "understory/preprocess/event_orderer.h"

// Checkpoints: whole files, and the states in them where the checksum is right. The first byte says
// what the rest is read as: 0 and 1 checkpoint.bin, alone and beside an older one; 2 EventOrderer,
// 3 DenseOdometry, 4 StemPacer.
//
// Seeds are of `understory map "sim:demo?duration_s=3&lidar.model=VLP-16" -o RUN`, dense and by
// stems, with --set run.checkpoint_interval_s=1: checkpoint.bin of the killed run, cut to 4 kB, and
// what `save` of these classes wrote into it.
namespace understory {
namespace {

void read_files(const std::string& bytes) {
  const std::filesystem::path work = fuzz_folder();
  std::ofstream(checkpoint_file(work, 0), std::ios::binary) << bytes;
  std::ofstream(checkpoint_file(work, 1), std::ios::binary) << bytes.substr(bytes.size() / 2);
  std::vector<std::string> problems;
  (void)read_checkpoints(work, problems);
}

Rig rig_with_imu() {
  Rig rig;
  rig.body_from_imu = Pose();
  return rig;
}

void read_as(std::uint8_t kind, const std::string& bytes) {
  BinaryReader reader(bytes, "fuzz");
  Log log;
  StageTimes times;
  if (kind == 0) {
    (void)parse_checkpoint("fuzz", bytes);
  } else if (kind == 1) {
    read_files(bytes);
  } else if (kind == 2) {
    EventOrderer({}, log).load(reader);
  } else if (kind == 3) {
    DenseOdometry({}, rig_with_imu(), times, log).load(reader);
  } else {
    StemPacer({}, {}, &log).load(reader);
  }
}

}  // namespace
}  // namespace understory

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  if (size == 0) return 0;
  const std::string bytes(reinterpret_cast<const char*>(data + 1), size - 1);
  expect_input_error_at_most([&] { read_as(data[0] % 5, bytes); });
  return 0;
}
