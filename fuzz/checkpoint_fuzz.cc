#include <fstream>
#include <string>

#include "fuzz_folder.h"
#include "understory/pipeline/run_folder/checkpoint.h"

// Checkpoints: whole files. The first byte says what the rest is read as: one checkpoint, or
// checkpoint.bin beside an older one. The states in a checkpoint are read only where its checksum
// is right, so they are not read here.
//
// Seeds are of `understory map "sim:demo?duration_s=3&lidar.model=VLP-16" -o RUN`, dense and by
// stems, with --set run.checkpoint_interval_s=1: checkpoint.bin of the killed run, cut to 4 kB.
namespace understory {
namespace {

void read_files(const std::string& bytes) {
  const std::filesystem::path work = fuzz_folder();
  std::ofstream(checkpoint_file(work, 0), std::ios::binary) << bytes;
  std::ofstream(checkpoint_file(work, 1), std::ios::binary) << bytes.substr(bytes.size() / 2);
  std::vector<std::string> problems;
  (void)read_checkpoints(work, problems);
}

void read_as(std::uint8_t kind, const std::string& bytes) {
  if (kind == 0) {
    (void)parse_checkpoint("fuzz", bytes);
  } else {
    read_files(bytes);
  }
}

}  // namespace
}  // namespace understory

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  if (size == 0) return 0;
  const std::string bytes(reinterpret_cast<const char*>(data + 1), size - 1);
  expect_input_error_at_most([&] { read_as(data[0] % 2, bytes); });
  return 0;
}
