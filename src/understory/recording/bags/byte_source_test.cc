#include "understory/recording/bags/byte_source.h"

#include <gtest/gtest.h>

#include <array>
#include <filesystem>

#include "understory/util/files/read_error.h"

namespace understory {
namespace {

// Bug: what a failing disk could not read was taken for the end of the file. Nothing can be read at
// the address 0 of the process's own memory, and the system says EIO as it does of such a disk.
TEST(ByteSource, AReadErrorIsNoEndOfTheFile) {
  const std::string memory = "/proc/self/mem";
  if (!std::filesystem::exists(memory)) GTEST_SKIP();
  const auto source = open_file(memory);
  std::array<std::uint8_t, 16> bytes{};
  try {
    (void)source->read(0, bytes.data(), bytes.size());
    FAIL() << "nothing was thrown";
  } catch (const ReadError& error) {
    EXPECT_NE(std::string(error.what()).find("at byte 0: cannot be read"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace understory
