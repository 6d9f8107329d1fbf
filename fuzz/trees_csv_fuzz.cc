#include "fuzz_file.h"
#include "understory/evaluation/trajectory.h"
#include "understory/evaluation/trees/tree_errors.h"
#include "understory/util/error.h"

namespace {

template <typename Read>
void attempt(const Read& read) {
  try {
    (void)read();
  } catch (const understory::InputError&) {
  }
}

}  // namespace

// The tables that are read by the names of their columns: trees.csv, velocity.csv, places.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  const FuzzFile file(data, size);
  attempt([&] { return read_trees(file.path()); });
  attempt([&] { return read_velocities(file.path()); });
  attempt([&] { return read_points(file.path()); });
  return 0;
}
