#include "understory/util/files/text_file.h"
#include "understory/util/files/read_error.h"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cerrno>
#include <fstream>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

TEST(TextFile, ReadsAllOfIt) {
  const test::TemporaryFolder folder;
  const std::string text = std::string(200'000, 'a') + "\n";
  std::ofstream(folder / "a.txt") << text;
  EXPECT_EQ(read_text_file(folder / "a.txt"), text);
  EXPECT_THROW((void)read_text_file(folder / "a.txt", 1000), InputError);
  EXPECT_THROW((void)read_text_file(folder / "none.txt"), InputError);
}

TEST(TextFile, SaysWhereAndWhyAFileCannotBeRead) {
  try {
    (void)read_text_file("/");  // opens, and fails to be read
    FAIL();
  } catch (const ReadError& error) {
    EXPECT_STREQ(error.what(), "/: at byte 0: cannot be read: Is a directory");
  }
}

// A stream that fails after its first line, as one on a failing disk does.
class FailingBuffer : public std::streambuf {
 public:
  FailingBuffer() { setg(line_, line_, line_ + 6); }

 protected:
  int_type underflow() override {
    errno = EIO;
    throw std::ios_base::failure("read");
  }

 private:
  char line_[7] = "first\n";
};

TEST(TextFile, LinesTellAFailureFromTheEnd) {
  FailingBuffer buffer;
  std::istream stream(&buffer);
  std::string line;
  EXPECT_TRUE(read_line(stream, line, "x.txt", 1));
  EXPECT_EQ(line, "first");
  try {
    (void)read_line(stream, line, "x.txt", 2);
    FAIL();
  } catch (const ReadError& error) {
    EXPECT_STREQ(error.what(), "x.txt: line 2: cannot be read: Input/output error");
  }
}

TEST(TextFile, YamlIsBounded) {
  EXPECT_EQ(load_yaml("a: [1, 2]", "x").size(), 1U);
  EXPECT_THROW((void)load_yaml(std::string(100'000, '['), "x"), ConfigError);
  std::string nested;
  for (int i = 0; i < 200; ++i)
    nested += std::string(static_cast<std::size_t>(i), ' ') + "a:\n";
  EXPECT_THROW((void)load_yaml(nested, "x"), ConfigError);
  // An alias that holds itself, and one that grows ninefold each time.
  EXPECT_THROW((void)load_yaml("&a [*a]", "x"), ConfigError);
  std::string laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 10; ++i) {
    const std::string before = "*a" + std::to_string(i - 1);
    laughs += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" + before;
    for (int k = 1; k < 9; ++k)
      laughs += ", " + before;
    laughs += "]\n";
  }
  EXPECT_THROW((void)load_yaml(laughs, "x"), ConfigError);
  EXPECT_THROW((void)load_yaml(std::string(std::size_t{17} << 20, ' '), "x"), ConfigError);
}

}  // namespace
}  // namespace understory
