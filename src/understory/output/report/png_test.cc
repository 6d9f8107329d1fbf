#include "understory/output/report/png.h"

#include <gtest/gtest.h>

#include <cstdint>

#include "understory/output/report/png_test_support.h"

namespace understory {
namespace {

TEST(Png, PixelsAndColoursComeBack) {
  PalettePicture picture{3, 2, {{255, 255, 255}, {10, 20, 30}, {200, 0, 7}}, {0, 1, 2, 2, 2, 1}};
  picture.at(0, 1) = 0;
  const test::DecodedPng png = test::decode_png(encode_png(picture));
  EXPECT_EQ(png.width, 3);
  EXPECT_EQ(png.height, 2);
  EXPECT_EQ(png.palette, std::string("\xff\xff\xff\x0a\x14\x1e\xc8\x00\x07", 9));
  EXPECT_EQ(png.opacity, std::string(1, '\0')) << "colour 0 is transparent, the others are not";
  ASSERT_EQ(png.rows.size(), 2U);
  EXPECT_EQ(png.rows[0], std::string("\x00\x01\x02", 3));
  EXPECT_EQ(png.rows[1], std::string("\x00\x02\x01", 3));
}

TEST(Png, ALargePictureComesBack) {
  PalettePicture picture{400, 300, {{0, 0, 0}, {1, 1, 1}}, {}};
  for (std::int64_t i = 0; i < 400 * 300; ++i)
    picture.pixels.push_back(static_cast<std::uint8_t>(i * i % 7 == 1 ? 1 : 0));
  const test::DecodedPng png = test::decode_png(encode_png(picture));
  ASSERT_EQ(png.rows.size(), 300U);
  for (int row = 0; row < 300; ++row) {
    for (int column = 0; column < 400; ++column)
      ASSERT_EQ(png.rows[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)],
                static_cast<char>(picture.at(column, row)));
  }
  EXPECT_EQ(encode_png(picture), encode_png(picture));
}

// RFC 4648, section 10.
TEST(Png, Base64IsThatOfTheStandard) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foob"), "Zm9vYg==");
  EXPECT_EQ(base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64("\xfb\xff\xfe"), "+//+");
}

}  // namespace
}  // namespace understory
