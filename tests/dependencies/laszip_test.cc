// LASzip as it is linked here: a compressed file read back point by point.

#include <gtest/gtest.h>
#include <laszip/laszip_api.h>

#include <cstring>
#include <filesystem>
#include <string>

namespace {

const int kPoints = 1000;

laszip_I32 coordinate(int index, int axis) {
  return 1000 * axis + (index * 7919) % 5003 - 2500;
}

void write_points(const std::string& path) {
  laszip_POINTER writer = nullptr;
  ASSERT_EQ(laszip_create(&writer), 0);
  laszip_header* header = nullptr;
  ASSERT_EQ(laszip_get_header_pointer(writer, &header), 0);
  header->version_major = 1;
  header->version_minor = 4;
  header->header_size = 375;
  header->offset_to_point_data = 375;
  header->point_data_format = 6;
  header->point_data_record_length = 30;
  header->x_scale_factor = header->y_scale_factor = header->z_scale_factor = 0.001;
  header->extended_number_of_point_records = kPoints;
  ASSERT_EQ(laszip_open_writer(writer, path.c_str(), 1), 0);
  laszip_point* point = nullptr;
  ASSERT_EQ(laszip_get_point_pointer(writer, &point), 0);
  for (int i = 0; i < kPoints; ++i) {
    point->X = coordinate(i, 0);
    point->Y = coordinate(i, 1);
    point->Z = coordinate(i, 2);
    ASSERT_EQ(laszip_write_point(writer), 0);
  }
  ASSERT_EQ(laszip_close_writer(writer), 0);
  laszip_destroy(writer);
}

TEST(Laszip, ReadsBackWhatItWrote) {
  const std::string path =
      (std::filesystem::temp_directory_path() / "understory_laszip_test.laz").string();
  write_points(path);
  ASSERT_LT(std::filesystem::file_size(path), 375 + 30 * kPoints);

  laszip_POINTER reader = nullptr;
  ASSERT_EQ(laszip_create(&reader), 0);
  laszip_BOOL compressed = 0;
  ASSERT_EQ(laszip_open_reader(reader, path.c_str(), &compressed), 0);
  EXPECT_TRUE(compressed);
  laszip_point* point = nullptr;
  ASSERT_EQ(laszip_get_point_pointer(reader, &point), 0);
  for (int i = 0; i < kPoints; ++i) {
    ASSERT_EQ(laszip_read_point(reader), 0);
    ASSERT_EQ(point->X, coordinate(i, 0));
    ASSERT_EQ(point->Y, coordinate(i, 1));
    ASSERT_EQ(point->Z, coordinate(i, 2));
  }
  laszip_close_reader(reader);
  laszip_destroy(reader);
  std::filesystem::remove(path);
}

}  // namespace
