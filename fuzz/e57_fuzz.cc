#include "fuzz_input.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/recording/clouds/e57_pages.h"
#include "understory/util/error.h"

// The input is the file without checksums: they are made here, or no changed byte would get past
// them.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  Log log;
  try {
    const std::vector<std::uint8_t> pages = e57_pages_of(ByteSpan(data, size));
    const auto file = fuzz_source(pages.data(), pages.size());
    (void)read_cloud(*file, log);
  } catch (const InputError&) {
  }
  return 0;
}
