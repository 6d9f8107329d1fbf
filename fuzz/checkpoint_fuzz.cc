#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "fuzz_input.h"
#include "understory/odometry/stem_pacer.h"
#include "understory/pipeline/checkpoint.h"
#include "understory/pipeline/run_folder.h"
#include "understory/pipeline/run_state.h"
#include "understory/preprocess/event_orderer.h"
#include "understory/util/error.h"

// A checkpoint: its frame, and what is in it where the checksum is right.
namespace understory {
namespace {

template <typename Work>
void guarded(const Work& work) {
  try {
    work();
  } catch (const InputError&) {
  }
}

const std::filesystem::path& folder() {
  static const std::filesystem::path path = [] {
    const auto made = std::filesystem::temp_directory_path() /
                      ("understory_checkpoint_fuzz_" + std::to_string(::getpid()));
    std::filesystem::create_directories(work_folder_of(made));
    return made;
  }();
  return path;
}

}  // namespace
}  // namespace understory

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  guarded([&] { (void)parse_checkpoint("fuzz", bytes); });
  guarded([&] {
    write_checkpoint(work_folder_of(folder()), 0, bytes);
    (void)RunState::reopen(folder());
  });
  guarded([&] {
    BinaryReader reader(bytes, "fuzz");
    Log log;
    EventOrderer orderer({}, log);
    orderer.load(reader);
  });
  guarded([&] {
    BinaryReader reader(bytes, "fuzz");
    StemPacer pacer({}, {}, nullptr);
    pacer.load(reader);
  });
  return 0;
}
