#include "understory/util/files/record_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

class RecordFileTest : public ::testing::Test {
 protected:
  static std::vector<std::string> all(const std::filesystem::path& path, const RecordCount& known) {
    std::vector<std::string> texts;
    for_each_record(path, known, [&](std::uint64_t, RecordFile::Bytes bytes) {
      texts.emplace_back(bytes.begin(), bytes.end());
    });
    return texts;
  }
  // Five records, "" to "xxxx", and the counts after each.
  std::vector<RecordCount> write() const {
    RecordFile file(path_);
    std::vector<RecordCount> counts;
    for (std::size_t i = 0; i < 5; ++i) {
      file.append({bytes_of(std::string(i, 'x'))});
      counts.push_back(file.count());
    }
    file.sync();
    return counts;
  }
  void put(std::streamoff at, char c) const {
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(at);
    file.put(c);
  }
  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "records";
};

TEST_F(RecordFileTest, GivesBackWhatWasAppendedInAnyOrder) {
  RecordFile file(path_);
  const std::uint64_t first = file.append({bytes_of(std::string("one")), bytes_of(7)});
  const std::uint64_t second = file.append({bytes_of(std::string("two"))});
  const std::vector<std::uint8_t> two = file.read(1, second);
  EXPECT_EQ(std::string(two.begin(), two.end()), "two");
  EXPECT_EQ(file.read(0, first).size(), 3 + sizeof(int));
  EXPECT_THROW(static_cast<void>(file.read(0, second)), InputError);  // another's place
  EXPECT_EQ(file.count().records, 2U);
  EXPECT_EQ(file.count().bytes, std::filesystem::file_size(path_));
}

TEST_F(RecordFileTest, GoesOnBehindWhatIsKnownAndCutsOffTheRest) {
  const std::vector<RecordCount> counts = write();
  std::vector<std::uint64_t> offsets;
  RecordFile file(path_, counts[2], &offsets);
  EXPECT_EQ(offsets, (std::vector<std::uint64_t>{0, 8, 17}));
  file.append({bytes_of(std::string("new"))});
  EXPECT_EQ(all(path_, file.count()), (std::vector<std::string>{"", "x", "xx", "new"}));
}

// A power cut leaves whatever: too little, zeros, or the bytes of something else.
TEST_F(RecordFileTest, WhatIsMissingOrDamagedIsAnInputErrorAndStays) {
  const std::vector<RecordCount> counts = write();
  const auto size = std::filesystem::file_size(path_);
  for (std::uintmax_t at = 0; at < size; ++at) {
    write();
    char before = 0;
    std::ifstream(path_, std::ios::binary).seekg(static_cast<std::streamoff>(at)).get(before);
    put(static_cast<std::streamoff>(at), static_cast<char>(before ^ 0x40));
    EXPECT_THROW(all(path_, counts.back()), InputError) << "byte " << at;
    EXPECT_EQ(std::filesystem::file_size(path_), size);
    if (at >= counts[2].bytes) {
      EXPECT_EQ(all(path_, counts[2]).size(), 3U);
    }
  }
  write();
  std::filesystem::resize_file(path_, size - 1);
  EXPECT_THROW(all(path_, counts.back()), InputError);
  EXPECT_THROW(RecordFile(path_, counts.back()), InputError);
  EXPECT_EQ(std::filesystem::file_size(path_), size - 1);
  EXPECT_THROW(all(folder_ / "none", counts.back()), InputError);
}

// The same number of bytes and records, each with its own checksum right: but not the same ones.
TEST_F(RecordFileTest, OtherRecordsThanThoseCountedAreAnInputError) {
  const std::vector<RecordCount> counts = write();
  {
    RecordFile file(path_, counts[3]);
    file.append({bytes_of(std::string("yyyy"))});
    EXPECT_EQ(file.count().bytes, counts[4].bytes);
  }
  EXPECT_EQ(all(path_, counts[3]).size(), 4U);
  EXPECT_THROW(all(path_, counts[4]), InputError);
}

TEST_F(RecordFileTest, AbsurdCountsCostNothing) {
  write();
  EXPECT_THROW(all(path_, {~0ULL, 20, 0}), InputError);
  EXPECT_THROW(all(path_, {3, ~0ULL, 0}), InputError);
  put(0, '\x7f');
  put(3, '\x7f');  // a length of 2 GB
  EXPECT_THROW(all(path_, {1, 8, 0}), InputError);
}

TEST_F(RecordFileTest, WhatCannotBeWrittenIsAnOutputError) {
  EXPECT_THROW(RecordFile(folder_ / "missing" / "file"), OutputError);
}

}  // namespace
}  // namespace understory
