#include "fuzz_file.h"
#include "understory/recording/clouds/stems_file.h"
#include "understory/util/error.h"

// stems.csv and stems.csv.gz.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  const FuzzFile file(data, size);
  Log log;
  try {
    (void)read_stem_views(file.path(), log);
  } catch (const InputError&) {
  }
  return 0;
}
