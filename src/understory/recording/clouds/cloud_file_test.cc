#include "understory/recording/clouds/cloud_file.h"

#include <gtest/gtest.h>
#include <laszip/laszip_api.h>

#include <cmath>
#include <functional>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/captures/packet_test_support.h"
#include "understory/recording/clouds/cloud_table.h"
#include "understory/recording/recording_test_support.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using test::Bytes;

constexpr int kCloudPoints = 50;
const float kNan = std::nanf("");

struct TestPoint {
  float x, y, z, intensity;
  std::uint32_t t;
};

TestPoint test_point(int i) {
  return {0.5F * static_cast<float>(i), -3.25F, 1.0F + static_cast<float>(i % 7),
          static_cast<float>(i), static_cast<std::uint32_t>(1000 * i)};
}

std::string pcd_header(const std::string& data, int points = kCloudPoints) {
  return "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity t\nSIZE 4 4 4 4 4\nTYPE F F F F U\n"
         "COUNT 1 1 1 1 1\nWIDTH " +
         std::to_string(points) + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " +
         std::to_string(points) + "\nDATA " + data + "\n";
}

std::string ply_header(const std::string& format) {
  return "ply\nformat " + format + " 1.0\ncomment made for a test\nelement vertex " +
         std::to_string(kCloudPoints) +
         "\nproperty float x\nproperty float y\nproperty float z\nproperty float "
         "scalar_Intensity\nproperty uint t\nelement face 0\nproperty list uchar int "
         "vertex_indices\nend_header\n";
}

std::string ascii_points() {
  std::string text;
  for (int i = 0; i < kCloudPoints; ++i) {
    const TestPoint p = test_point(i);
    text += std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z) + " " +
            std::to_string(p.intensity) + " " + std::to_string(p.t) + "\n";
  }
  return text;
}

Bytes binary_points(bool with_time = true, bool swap = false) {
  Bytes bytes;
  for (int i = 0; i < kCloudPoints; ++i) {
    const TestPoint p = test_point(i);
    for (const float value : {p.x, p.y, p.z, p.intensity})
      test::put(bytes, value);
    if (with_time) test::put(bytes, p.t);
  }
  if (swap) {
    for (std::size_t i = 0; i + 4 <= bytes.size(); i += 4)
      std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(i),
                   bytes.begin() + static_cast<std::ptrdiff_t>(i + 4));
  }
  return bytes;
}

Bytes join(const std::string& header, const Bytes& body) {
  Bytes bytes(header.begin(), header.end());
  test::append(bytes, body);
  return bytes;
}

// How many bytes from `at` on repeat those four before them.
std::size_t repeats(const Bytes& in, std::size_t at) {
  std::size_t match = 0;
  while (at >= 4 && match < 200 && at + match < in.size() && in[at + match] == in[at - 4 + match])
    ++match;
  return match;
}

// Literal runs and back references, as a compressor makes them.
Bytes lzf_compress(const Bytes& in) {
  Bytes out;
  std::size_t at = 0;
  while (at < in.size()) {
    const std::size_t match = repeats(in, at);
    if (match >= 3) {
      const std::size_t length = match - 2;
      out.push_back(static_cast<std::uint8_t>(std::min<std::size_t>(length, 7) << 5));
      if (length >= 7) out.push_back(static_cast<std::uint8_t>(length - 7));
      out.push_back(3);  // four back
      at += match;
      continue;
    }
    const std::size_t begin = at;
    do {
      ++at;
    } while (at < in.size() && at - begin < 32 && repeats(in, at) < 3);
    out.push_back(static_cast<std::uint8_t>(at - begin - 1));
    for (std::size_t i = begin; i < at; ++i)
      out.push_back(in[i]);
  }
  return out;
}

Bytes compressed_points() {
  Bytes columns;
  for (int field = 0; field < 5; ++field) {
    for (int i = 0; i < kCloudPoints; ++i) {
      const TestPoint p = test_point(i);
      const float values[] = {p.x, p.y, p.z, p.intensity};
      if (field < 4) {
        test::put(columns, values[field]);
      } else {
        test::put(columns, p.t);
      }
    }
  }
  const Bytes packed = lzf_compress(columns);
  EXPECT_LT(packed.size(), columns.size());
  Bytes bytes;
  test::put(bytes, static_cast<std::uint32_t>(packed.size()));
  test::put(bytes, static_cast<std::uint32_t>(columns.size()));
  test::append(bytes, packed);
  return bytes;
}

PointCloudFile read_cloud_bytes(const Bytes& bytes, Log& log, const std::string& name = "cloud.x") {
  const auto file = bytes_in_memory(bytes, name);
  return read_cloud(*file, log);
}

void expect_points(const Bytes& bytes, const std::string& format,
                   const std::string& name = "cloud.x") {
  Log log;
  const PointCloudFile cloud = read_cloud_bytes(bytes, log, name);
  EXPECT_EQ(cloud.format, format);
  EXPECT_EQ(cloud.origin, Eigen::Vector3d::Zero());
  ASSERT_EQ(cloud.points.size(), static_cast<std::size_t>(kCloudPoints));
  for (int i = 0; i < kCloudPoints; ++i) {
    const TestPoint p = test_point(i);
    const auto k = static_cast<std::size_t>(i);
    EXPECT_EQ(cloud.points[k], Eigen::Vector3f(p.x, p.y, p.z));
    EXPECT_EQ(cloud.intensity[k], p.intensity);
  }
  EXPECT_TRUE(log.warnings().empty()) << test::all_warnings(log);
}

TEST(CloudFile, ReadsEveryEncoding) {
  expect_points(join(pcd_header("ascii") + ascii_points(), {}), "PCD ascii");
  expect_points(join(pcd_header("binary"), binary_points()), "PCD binary");
  expect_points(join(pcd_header("binary_compressed"), compressed_points()),
                "PCD binary_compressed");
  expect_points(join(ply_header("ascii") + ascii_points(), {}), "PLY ascii");
  expect_points(join(ply_header("binary_little_endian"), binary_points()),
                "PLY binary_little_endian");
  expect_points(join(ply_header("binary_big_endian"), binary_points(true, true)),
                "PLY binary_big_endian");
  expect_points(binary_points(false), "KITTI bin", "000000.bin");
}

TEST(CloudFile, KeepsWhatIsThereOfACutFile) {
  const std::vector<Bytes> files{
      join(pcd_header("binary"), binary_points()), join(pcd_header("ascii") + ascii_points(), {}),
      join(ply_header("binary_little_endian"), binary_points()), binary_points(false)};
  for (const Bytes& file : files) {
    Bytes cut(file.begin(), file.end() - 35);
    Log log;
    const PointCloudFile cloud = read_cloud_bytes(cut, log, "cut.bin");
    EXPECT_GE(cloud.points.size(), kCloudPoints - 3U);
    EXPECT_LT(cloud.points.size(), static_cast<std::size_t>(kCloudPoints));
    EXPECT_GE(test::count_of(log, "recording.damaged"), 1U);
  }
  // Compressed data hold the columns one after another: only the times are lost.
  Bytes compressed = join(pcd_header("binary_compressed"), compressed_points());
  compressed.resize(compressed.size() - 20);
  Log log;
  EXPECT_EQ(read_cloud_bytes(compressed, log).points.size(),
            static_cast<std::size_t>(kCloudPoints));
  EXPECT_EQ(test::count_of(log, "recording.damaged"), 1U);
}

std::size_t damage_in(const Bytes& file) {
  Log log;
  EXPECT_EQ(read_cloud_bytes(file, log).points.size(), static_cast<std::size_t>(kCloudPoints));
  return test::count_of(log, "recording.damaged");
}

// Bug: a header that states fewer points than there are took them silently away.
TEST(CloudFile, TellsOfPointsBehindThoseOfTheHeader) {
  const std::string line = "1 2 3 4 5\n";
  for (const std::string& header : {pcd_header("ascii"), ply_header("ascii")}) {
    EXPECT_EQ(damage_in(join(header + ascii_points() + line, {})), 1U);
    EXPECT_EQ(damage_in(join(header + ascii_points() + "\n \n", {})), 0U);
  }
  for (const std::string& header : {pcd_header("binary"), ply_header("binary_little_endian")}) {
    const Bytes file = join(header, binary_points());
    Bytes longer = file;
    test::append(longer, Bytes(20, 7));
    EXPECT_EQ(damage_in(longer), 1U);
    longer = file;
    test::append(longer, Bytes(4096, 0));  // padding
    EXPECT_EQ(damage_in(longer), 0U);
  }
  // Faces behind the vertices are none of them.
  std::string faces = ply_header("ascii");
  faces.replace(faces.find("face 0"), 6, "face 2");
  EXPECT_EQ(damage_in(join(faces + ascii_points() + "4 0 1 2 3\n4 1 2 3 4\n", {})), 0U);
  EXPECT_EQ(damage_in(join(faces + ascii_points() + "4 0 1 2 3\n4 1 2 3 4\n" + line, {})), 1U);
  faces = ply_header("binary_little_endian");
  faces.replace(faces.find("face 0"), 6, "face 9");
  Bytes meshed = join(faces, binary_points());
  test::append(meshed, Bytes(117, 3));
  EXPECT_EQ(damage_in(meshed), 0U);
}

// Points of three numbers (Newer College's binaries) came through as a scan of points in wrong
// places.
TEST(CloudFile, RefusesBinariesOfAnotherPointSize) {
  const auto cloud_of = [](int numbers) {
    Bytes bytes;
    for (int i = 0; i < 1'600 * numbers; ++i) {
      const int column = i % numbers;
      const float value = column < 3 ? 20.0F * std::sin(0.7F * static_cast<float>(i)) : 0.5F;
      const auto* raw = reinterpret_cast<const std::uint8_t*>(&value);
      bytes.insert(bytes.end(), raw, raw + sizeof(value));
    }
    return bytes;
  };
  Log log;
  EXPECT_EQ(read_cloud_bytes(cloud_of(4), log, "a.bin").points.size(), 1'600U);
  for (const int numbers : {3, 5}) {
    try {
      (void)read_cloud_bytes(cloud_of(numbers), log, "a.bin");
      ADD_FAILURE() << numbers << " numbers a point were taken for four";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("intensities are negative"), std::string::npos);
    }
  }
}

TEST(CloudFile, RefusesWithTheFileAndThePlace) {
  const auto message_of = [](const Bytes& bytes) {
    Log log;
    try {
      (void)read_cloud_bytes(bytes, log, "bad.bin");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(message_of(join("# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4\n", {}))
                .find("bad.bin: line 4"),
            std::string::npos);
  EXPECT_NE(message_of(join(pcd_header("binary"), {})).find("bad.bin"), std::string::npos);
  EXPECT_NE(message_of(Bytes(64, 0xFF)).find("KITTI"), std::string::npos);
  Bytes huge = join(
      "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
      "WIDTH 4000000000\nHEIGHT 1\nPOINTS 4000000000\nDATA binary_compressed\n",
      {});
  test::put(huge, std::uint32_t{12});
  test::put(huge, std::uint32_t{0xFFFFFFFF});
  EXPECT_NE(message_of(huge).find("compressed points"), std::string::npos);
}

// A regression: stems of a cloud in a coordinate system, single precision, were rounded away.
TEST(CloudFile, SaysHowCoarseSinglePrecisionIsThere) {
  const auto step_at = [](const std::string& x, const std::string& size, const std::string& type) {
    const std::string text = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE " + size + "\nTYPE " +
                             type + "\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n" + x +
                             " 2 3\n";
    Log log;
    return read_cloud_bytes(Bytes(text.begin(), text.end()), log).step;
  };
  EXPECT_EQ(step_at("6800000", "4 4 4", "F F F"), 0.5);
  EXPECT_EQ(step_at("500000", "4 4 4", "F F F"), 0.03125);
  EXPECT_EQ(step_at("6800000", "8 8 8", "F F F"), 0.0);
  EXPECT_LT(step_at("500", "4 4 4", "F F F"), 1e-4);
}

TEST(CloudFile, LeavesOutNan) {
  Bytes bytes = join(pcd_header("binary"), binary_points());
  const std::size_t first = bytes.size() - 20 * kCloudPoints;
  std::memcpy(bytes.data() + first + 20 * 3 + 4, &kNan, 4);
  Log log;
  EXPECT_EQ(read_cloud_bytes(bytes, log).points.size(), kCloudPoints - 1U);
}

// A regression: the origin was the first point, so all others lost their places.
TEST(CloudFile, LeavesOutWhatIsFartherThanAnyPlace) {
  const std::string text =
      "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\n"
      "HEIGHT 1\nPOINTS 3\nDATA ascii\n1e30 0 0\n1 2 3\n6800000000 2 3\n";
  Log log;
  const PointCloudFile cloud = read_cloud_bytes(Bytes(text.begin(), text.end()), log);
  EXPECT_EQ(cloud.not_finite, 1U);
  ASSERT_EQ(cloud.points.size(), 2U);
  EXPECT_EQ(cloud.points.front(), Eigen::Vector3f(1, 2, 3));
}

TEST(Lzf, RefusesReferencesBeforeTheStart) {
  std::vector<std::uint8_t> out(10);
  std::size_t made = 0;
  const Bytes bad{0x00, 'a', 0x20, 0x05};
  EXPECT_FALSE(lzf_expand(bad, out, made));
  EXPECT_EQ(made, 1U);
  const Bytes run{0x00, 'a', 0xE0, 0x00, 0x00};  // nine more of the same
  ASSERT_TRUE(lzf_expand(run, out, made));
  EXPECT_EQ(out, std::vector<std::uint8_t>(10, 'a'));
}

// A LAS file in a coordinate system, written by LASzip.
void write_las(const std::string& path, int format, bool compressed,
               const std::function<void(laszip_point&, int)>& change = {}) {
  laszip_POINTER writer = nullptr;
  laszip_create(&writer);
  laszip_header* header = nullptr;
  laszip_get_header_pointer(writer, &header);
  const bool modern = format >= 6;
  header->version_major = 1;
  header->version_minor = modern ? 4 : 2;
  header->header_size = modern ? 375 : 227;
  header->offset_to_point_data = header->header_size;
  header->point_data_format = static_cast<laszip_U8>(format);
  header->point_data_record_length = modern ? 30 : 28;
  header->x_scale_factor = header->y_scale_factor = header->z_scale_factor = 0.001;
  header->x_offset = 500000.0;
  header->y_offset = 5200000.0;
  if (modern) {
    header->extended_number_of_point_records = kCloudPoints;
  } else {
    header->number_of_point_records = kCloudPoints;
  }
  ASSERT_EQ(laszip_open_writer(writer, path.c_str(), compressed ? 1 : 0), 0);
  laszip_point* point = nullptr;
  laszip_get_point_pointer(writer, &point);
  for (int i = 0; i < kCloudPoints; ++i) {
    point->X = 1000 * i;
    point->Y = -250 * i;
    point->Z = 123 + i;
    point->intensity = static_cast<laszip_U16>(100 + i);
    point->gps_time = 1000.0 + 0.5 * i;
    // Classes beyond 31 have no place in the old field.
    point->classification = static_cast<laszip_U8>(i % 2 == 0 ? 2 : modern ? 0 : 5) & 0x1F;
    point->extended_classification = static_cast<laszip_U8>(i % 2 == 0 ? 2 : 65);
    if (change) change(*point, i);
    ASSERT_EQ(laszip_write_point(writer), 0);
  }
  ASSERT_EQ(laszip_close_writer(writer), 0);
  laszip_destroy(writer);
}

TEST(CloudFile, ReadsLasAndLazInACoordinateSystem) {
  const test::TemporaryFolder folder;
  for (const int format : {1, 6}) {
    for (const bool compressed : {false, true}) {
      const std::string path = folder / (compressed ? "cloud.laz" : "cloud.las");
      write_las(path, format, compressed);
      Log log;
      const PointCloudFile cloud = read_cloud(path, log);
      ASSERT_EQ(cloud.points.size(), static_cast<std::size_t>(kCloudPoints)) << cloud.format;
      EXPECT_EQ(cloud.origin, Eigen::Vector3d(500000.0, 5200000.0, 0.0));
      for (int i = 0; i < kCloudPoints; ++i) {
        const auto k = static_cast<std::size_t>(i);
        const Eigen::Vector3d position = cloud.origin + cloud.points[k].cast<double>();
        const Eigen::Vector3d expected(500000.0 + i, 5200000.0 - 0.25 * i, 0.123 + 0.001 * i);
        EXPECT_NEAR((position - expected).norm(), 0.0, 1e-5);
        EXPECT_EQ(cloud.intensity[k], 100.0F + static_cast<float>(i));
        EXPECT_EQ(cloud.gps_time[k], 1000.0 + 0.5 * i);
        EXPECT_EQ(cloud.classification[k], i % 2 == 0 ? 2 : format == 6 ? 65 : 5);
      }
      EXPECT_TRUE(log.warnings().empty()) << test::all_warnings(log);
    }
  }
}

// A regression: noise was mapped as all other points, and told that z is not up.
TEST(CloudFile, LeavesOutNoiseAndWithheldPoints) {
  const test::TemporaryFolder folder;
  for (const int format : {1, 6}) {
    for (const bool compressed : {false, true}) {
      const std::string path = folder / (compressed ? "cloud.laz" : "cloud.las");
      write_las(path, format, compressed, [&](laszip_point& point, int i) {
        if (i == 3) point.classification = point.extended_classification = 7;
        if (i == 4) point.classification = point.extended_classification = 18;
        const bool withheld = i == 5;
        point.withheld_flag = withheld ? 1 : 0;
        point.extended_classification_flags = withheld ? 4 : 0;
      });
      Log log;
      const PointCloudFile cloud = read_cloud(path, log);
      EXPECT_EQ(cloud.points.size(), kCloudPoints - 3U) << cloud.format;
      EXPECT_EQ(test::count_of(log, "recording.noise"), 1U) << test::all_warnings(log);
      EXPECT_NE(test::all_warnings(log).find("3 points are left out"), std::string::npos);
    }
  }
}

TEST(CloudFile, KeepsWhatThisProgramCallsNoise) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "cloud.las";
  write_las(path, 1, false, [](laszip_point& point, int) { point.classification = 7; });
  Bytes bytes = test::read_bytes(path);
  const std::string name = "understory SLAM";
  std::copy(name.begin(), name.end(), bytes.begin() + 26);
  Log log;
  EXPECT_EQ(read_cloud_bytes(bytes, log).points.size(), static_cast<std::size_t>(kCloudPoints));
}

// LASzip alone reads out of bounds on some of these.
TEST(CloudFile, SurvivesFlippedBytesInLaz) {
  const test::TemporaryFolder folder;
  write_las(folder / "cloud.laz", 6, true);
  const Bytes good = test::read_bytes(folder / "cloud.laz");
  int readable = 0;
  for (std::size_t at = 375; at < good.size(); at += 3) {
    Bytes bytes = good;
    bytes[at] ^= 0xFF;
    Log log;
    try {
      readable += read_cloud_bytes(bytes, log).points.empty() ? 0 : 1;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("cloud.x"), std::string::npos);
    }
  }
  EXPECT_GT(readable, 0);
}

TEST(CloudFile, FindsTheCoordinateSystemInGeoKeys) {
  const test::TemporaryFolder folder;
  write_las(folder / "cloud.las", 1, false);
  Bytes bytes = test::read_bytes(folder / "cloud.las");
  Bytes vlr(54, 0);
  const std::string user = "LASF_Projection";
  std::copy(user.begin(), user.end(), vlr.begin() + 2);
  vlr[18] = 34735 & 0xFF;
  vlr[19] = 34735 >> 8;
  vlr[20] = 16;
  for (const std::uint16_t key : {1, 1, 0, 1, 3072, 0, 1, 25832})
    test::put(vlr, key);
  bytes.insert(bytes.begin() + 227, vlr.begin(), vlr.end());
  const std::uint32_t offset = 227 + 54 + 16;
  const std::uint32_t records = 1;
  std::memcpy(bytes.data() + 96, &offset, 4);
  std::memcpy(bytes.data() + 100, &records, 4);
  Log log;
  const PointCloudFile cloud = read_cloud_bytes(bytes, log);
  EXPECT_EQ(cloud.coordinate_system, "EPSG:25832");
  EXPECT_EQ(cloud.points.size(), static_cast<std::size_t>(kCloudPoints));
}

TEST(CloudFile, KeepsWhatIsThereOfACutLas) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "cloud.las";
  write_las(path, 1, false);
  Bytes bytes = test::read_bytes(path);
  bytes.resize(bytes.size() - 100);
  Log log;
  EXPECT_EQ(read_cloud_bytes(bytes, log).points.size(), kCloudPoints - 4U);
  EXPECT_EQ(test::count_of(log, "recording.damaged"), 1U);
  bytes.resize(227);
  EXPECT_THROW((void)read_cloud_bytes(bytes, log), InputError);
  bytes.resize(100);
  EXPECT_THROW((void)read_cloud_bytes(bytes, log), InputError);
}

// A cut at the very end takes a part of LASzip's table of chunks away; no point came through.
TEST(CloudFile, KeepsThePointsOfALazWhoseTableOfChunksIsCut) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "cloud.laz";
  write_las(path, 1, true);
  Bytes bytes = test::read_bytes(path);
  for (int cut = 1; cut <= 6; ++cut) {
    bytes.pop_back();
    Log log;
    EXPECT_EQ(read_cloud_bytes(bytes, log).points.size(), static_cast<std::size_t>(kCloudPoints))
        << cut << " bytes cut";
  }
}

TEST(CloudFile, ReadsRealClouds) {
  const auto folder = test::data_folder();
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no example data";
  Log log;
  const PointCloudFile mls = read_cloud(folder / "spanner_mls_uas_als" / "MLS_Clip.laz", log);
  EXPECT_EQ(mls.points.size(), 301'477U);
  EXPECT_GT(mls.origin.norm(), 1e5);
  const PointCloudFile kitti = read_cloud(folder / "kitti00_0-3" / "000000.bin", log);
  EXPECT_EQ(kitti.points.size(), 124'668U);
}

}  // namespace
}  // namespace understory
