#include "understory/util/files/csv.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <fstream>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

class Csv : public ::testing::Test {
 protected:
  std::filesystem::path plain(const std::string& text) {
    std::ofstream(folder_.path() / "table.csv", std::ios::binary) << text;
    return folder_.path() / "table.csv";
  }
  std::filesystem::path packed(const std::string& text) {
    const std::string path = (folder_.path() / "table.csv.gz").string();
    gzFile file = gzopen(path.c_str(), "wb");
    gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
    gzclose(file);
    return path;
  }
  test::TemporaryFolder folder_;
};

template <typename Action>
std::string complaint(const Action& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST_F(Csv, ReadsPlainAndPackedTablesAlike) {
  const std::string text =
      "\xef\xbb\xbfid, x ,name\r\n# none\r\n\r\n1, 2.5 ,pine\r\n2,,\"birch, \"\"old\"\"\"\n";
  for (const auto& path : {plain(text), packed(text)}) {
    CsvReader table(path, {"id", "x"});
    ASSERT_TRUE(table.next());
    EXPECT_EQ(table.number("x"), 2.5);
    EXPECT_EQ(table.text("name"), "pine");
    ASSERT_TRUE(table.next());
    EXPECT_TRUE(std::isnan(table.number("x")));
    EXPECT_EQ(table.text("name"), "birch, \"old\"");
    EXPECT_TRUE(std::isnan(table.number("absent")));
    EXPECT_FALSE(table.next());
  }
}

TEST_F(Csv, SaysWhatIsWrongAndWhere) {
  EXPECT_NE(complaint([&] { CsvReader(plain("")); }).find("header line"), std::string::npos);
  EXPECT_NE(complaint([&] { CsvReader(plain("a,b\n"), {"c"}); }).find("column 'c'"),
            std::string::npos);
  EXPECT_NE(complaint([&] { CsvReader(plain("a;b\n"), {"a"}); }).find("by semicolons"),
            std::string::npos);
  CsvReader table(plain("a,b\n1,two\n3\n"), {"a"});
  ASSERT_TRUE(table.next());
  EXPECT_NE(complaint([&] { (void)table.number("b"); }).find("line 2: expected a number"),
            std::string::npos);
  EXPECT_NE(complaint([&] { (void)table.next(); }).find("line 3: expected 2 cells, found 1"),
            std::string::npos);
  CsvFormat exact;
  exact.exact_width = true;
  CsvReader wide(plain("a,b\n1,2,3\n"), {}, exact);
  EXPECT_NE(complaint([&] { (void)wide.next(); }).find("found 3"), std::string::npos);
}

// A regression: numbers with decimal commas were read into wrong columns.
TEST_F(Csv, ARowThatIsLongerThanTheHeaderIsRefused) {
  CsvReader commas(plain("id,x,y\nA,5,5,5,5\n"), {"x"});
  EXPECT_NE(complaint([&] { (void)commas.next(); }).find("decimal commas"), std::string::npos);
  CsvReader blank(plain("id,x,y\nA,5,5,\n"), {"x"});
  ASSERT_TRUE(blank.next());
  EXPECT_EQ(blank.number("y"), 5.0);
}

TEST_F(Csv, ATableThatWasCutShortIsNotItsEnd) {
  std::string text = "a\n";
  for (int i = 0; i < 100'000; ++i)
    text += std::to_string(i * 7919 % 100'003) + "\n";
  const auto path = packed(text);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  CsvReader table(path, {"a"});
  int rows = 0;
  const std::string reason = complaint([&] {
    while (table.next())
      ++rows;
  });
  EXPECT_GT(rows, 1000);
  EXPECT_NE(reason.find("expected an undamaged gzip stream"), std::string::npos) << reason;
}

TEST_F(Csv, ShortRowsArePassedOverWhereTheCallerIsTold) {
  std::vector<std::string> told;
  CsvFormat format;
  format.any_case = format.header_in_comment = true;
  format.on_short_row = [&](const std::string& problem) { told.push_back(problem); };
  CsvReader table(plain("# a comment\n#A,B\n1\n2,3\n" + std::string(2U << 20, '9') + "\n4,5\n"),
                  {"a"}, format);
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.number("b"), 3.0);
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.number("b"), 5.0);
  EXPECT_EQ(told.size(), 2U);
  EXPECT_EQ(table.lines().line_number(), 6U);
}

TEST_F(Csv, GoesOnWhereItStood) {
  std::string text = "a\n";
  for (int i = 0; i < 50'000; ++i)
    text += std::to_string(i) + "\n";
  for (const auto& path : {plain(text), packed(text)}) {
    CsvReader first(path, {"a"});
    for (int i = 0; i <= 30'000; ++i)
      ASSERT_TRUE(first.next());
    BinaryWriter writer;
    first.save(writer);
    CsvReader again(path, {"a"});
    BinaryReader reader(writer.bytes(), "place");
    again.load(reader);
    ASSERT_TRUE(again.next());
    EXPECT_EQ(again.number("a"), 30'001.0);
    EXPECT_EQ(again.lines().line_number(), 30'003U);
  }
}

TEST(CsvCell, IsEmptyWhereUnknownAndNeverMinusZero) {
  EXPECT_EQ(csv_cell(1.23456, 3), "1.235");
  EXPECT_EQ(csv_cell(-0.0001, 3), "0.000");
  EXPECT_EQ(csv_cell(std::nan(""), 3), "");
  EXPECT_EQ(csv_text("Scots pine"), "Scots pine");
  EXPECT_EQ(csv_text("pine, \"old\"\nor dead"), "\"pine, \"\"old\"\" or dead\"");
}

}  // namespace
}  // namespace understory
