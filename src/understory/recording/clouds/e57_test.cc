#include "understory/recording/clouds/e57.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "understory/recording/captures/packet_test_support.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/recording/clouds/e57_pages.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using Eigen::Vector3d;
using test::Bytes;
using test::put;

// Integers of `bits` bits, one behind the other from the lowest bit on.
Bytes packed(const std::vector<std::uint64_t>& values, int bits) {
  Bytes bytes((values.size() * static_cast<std::size_t>(bits) + 7) / 8, 0);
  std::size_t at = 0;
  for (const std::uint64_t value : values) {
    for (int bit = 0; bit < bits; ++bit, ++at)
      bytes[at / 8] |=
          static_cast<std::uint8_t>(((value >> static_cast<unsigned>(bit)) & 1U) << (at % 8));
  }
  return bytes;
}

Bytes floats(const std::vector<float>& values) {
  Bytes bytes;
  for (const float value : values)
    put(bytes, value);
  return bytes;
}

// One packet with a part of each stream.
Bytes packet(const std::vector<Bytes>& streams) {
  Bytes body;
  put(body, static_cast<std::uint16_t>(streams.size()));
  for (const Bytes& stream : streams)
    put(body, static_cast<std::uint16_t>(stream.size()));
  for (const Bytes& stream : streams)
    body.insert(body.end(), stream.begin(), stream.end());
  while ((body.size() + 4) % 4 != 0)
    body.push_back(0);
  Bytes whole = {1, 0};
  put(whole, static_cast<std::uint16_t>(body.size() + 3));
  whole.insert(whole.end(), body.begin(), body.end());
  return whole;
}

std::uint64_t physical(std::uint64_t logical) {
  return E57Pages::behind(0, logical);
}

// An E57 file made by hand: sections of packets, and an XML part that names them.
class E57Maker {
 public:
  E57Maker() : logical_(48, 0) {}

  // Returns the section's place for the XML part.
  std::uint64_t add_section(const std::vector<Bytes>& packets) {
    const std::uint64_t at = logical_.size();
    std::uint64_t length = 32;
    for (const Bytes& one : packets)
      length += one.size();
    put(logical_, std::uint64_t{1});
    put(logical_, length);
    put(logical_, physical(at + 32));
    put(logical_, std::uint64_t{0});
    for (const Bytes& one : packets)
      logical_.insert(logical_.end(), one.begin(), one.end());
    return physical(at);
  }

  [[nodiscard]] Bytes file(const std::string& scans, const std::string& more = "") const {
    const std::string xml = "<?xml version=\"1.0\"?><e57Root type=\"Structure\">" + more +
                            "<data3D type=\"Vector\">" + scans + "</data3D></e57Root>";
    Bytes all = logical_;
    Bytes head;
    for (const char letter : std::string("ASTM-E57"))
      head.push_back(static_cast<std::uint8_t>(letter));
    put(head, std::uint32_t{1});
    put(head, std::uint32_t{0});
    put(head, std::uint64_t{0});
    put(head, physical(all.size()));
    put(head, std::uint64_t{xml.size()});
    put(head, std::uint64_t{1024});
    std::copy(head.begin(), head.end(), all.begin());
    all.insert(all.end(), xml.begin(), xml.end());
    return e57_pages_of(ByteSpan(all.data(), all.size()));
  }

 private:
  Bytes logical_;
};

std::string scan_xml(std::uint64_t place, std::size_t count, const std::string& prototype,
                     const std::string& pose = "") {
  return "<vectorChild type=\"Structure\"><name type=\"String\">one</name>" + pose +
         "<points type=\"CompressedVector\" fileOffset=\"" + std::to_string(place) +
         "\" recordCount=\"" + std::to_string(count) + "\"><prototype type=\"Structure\">" +
         prototype + "</prototype><codecs type=\"Vector\"/></points></vectorChild>";
}

constexpr const char* kFloats =
    "<cartesianX type=\"Float\" precision=\"single\"/><cartesianY type=\"Float\" "
    "precision=\"single\"/><cartesianZ type=\"Float\" precision=\"single\"/>";
// 17 bits, in millimetres from -50 m on.
constexpr const char* kScaled =
    "<cartesianX type=\"ScaledInteger\" minimum=\"-50000\" maximum=\"50000\" scale=\"0.001\"/>"
    "<cartesianY type=\"ScaledInteger\" minimum=\"-50000\" maximum=\"50000\" scale=\"0.001\"/>"
    "<cartesianZ type=\"ScaledInteger\" minimum=\"7\" maximum=\"7\" scale=\"0.5\" offset=\"1\"/>"
    "<cartesianInvalidState type=\"Integer\" minimum=\"0\" maximum=\"2\"/>"
    "<intensity type=\"Integer\" minimum=\"0\" maximum=\"255\"/>";

struct ReadCloud {
  PointCloudFile cloud;
  std::uint64_t damage = 0;
};

ReadCloud read_e57(Bytes bytes) {
  Log log;
  const auto source = bytes_in_memory(std::move(bytes), "cloud.e57");
  ReadCloud result{read_cloud(*source, log), 0};
  result.damage = found(log, Finding::kDamage).count;
  return result;
}

Vector3d point(const ReadCloud& read, std::size_t i) {
  return read.cloud.origin + read.cloud.points.at(i).cast<double>();
}

std::string refusal(Bytes bytes) {
  try {
    (void)read_e57(std::move(bytes));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(E57, FloatsComeWithThePoseOfTheirScan) {
  E57Maker maker;
  const std::uint64_t place =
      maker.add_section({packet({floats({1, 2}), floats({0, 1}), floats({5, 6})})});
  // A quarter turn about z, then 400 km east.
  const std::string pose =
      "<pose><rotation><w>0.7071067811865476</w><x/><y/><z>0.7071067811865476</z></rotation>"
      "<translation><x>400000.25</x><y>6800000</y><z>-2</z></translation></pose>";
  const ReadCloud got = read_e57(maker.file(scan_xml(place, 2, kFloats, pose),
                                            "<coordinateMetadata>EPSG:3067</coordinateMetadata>"));
  ASSERT_EQ(got.cloud.points.size(), 2U);
  EXPECT_LT((point(got, 0) - Vector3d(400000.25, 6800001.0, 3.0)).norm(), 1e-4);
  EXPECT_LT((point(got, 1) - Vector3d(399999.25, 6800002.0, 4.0)).norm(), 1e-4);
  EXPECT_EQ(got.cloud.coordinate_system, "EPSG:3067");
  EXPECT_EQ(got.cloud.format, "E57, 1 scan");
  EXPECT_LT(got.cloud.step, 1e-6) << "the large part of the coordinates is in the pose";
  EXPECT_EQ(got.damage, 0U);
}

TEST(E57, FloatsFarFromTheOriginSayHowCoarseTheyAre) {
  E57Maker maker;
  const std::uint64_t place =
      maker.add_section({packet({floats({400000}), floats({6.8e6F}), floats({5})})});
  EXPECT_EQ(read_e57(maker.file(scan_xml(place, 1, kFloats))).cloud.step, 0.5);
}

TEST(E57, NumbersOfAnyBitsRunOnFromPacketToPacket) {
  // 300 points; the packets end in the middle of numbers, and differently in each stream.
  std::vector<std::uint64_t> x;
  std::vector<std::uint64_t> y;
  std::vector<std::uint64_t> invalid;
  std::vector<std::uint64_t> intensity;
  for (std::uint64_t i = 0; i < 300; ++i) {
    x.push_back(50'000 + 97 * i);
    y.push_back(50'000 - 31 * i);
    invalid.push_back(i % 10 == 3 ? 2 : 0);
    intensity.push_back(i % 256);
  }
  const std::vector<Bytes> whole = {
      packed(x, 17), packed(y, 17), {}, packed(invalid, 2), packed(intensity, 8)};
  std::vector<Bytes> packets;
  std::vector<std::size_t> at(whole.size(), 0);
  for (int part = 0; part < 4; ++part) {
    std::vector<Bytes> streams;
    for (std::size_t k = 0; k < whole.size(); ++k) {
      const std::size_t end =
          part == 3 ? whole[k].size() : std::min(whole[k].size(), at[k] + 100 + 13 * k);
      streams.emplace_back(whole[k].begin() + static_cast<std::ptrdiff_t>(at[k]),
                           whole[k].begin() + static_cast<std::ptrdiff_t>(end));
      at[k] = end;
    }
    packets.push_back(packet(streams));
  }
  E57Maker maker;
  const std::uint64_t place = maker.add_section(packets);
  const ReadCloud got = read_e57(maker.file(scan_xml(place, 300, kScaled)));
  ASSERT_EQ(got.cloud.points.size(), 270U);
  EXPECT_EQ(got.damage, 0U);
  std::size_t k = 0;
  for (std::size_t i = 0; i < 300; ++i) {
    if (i % 10 == 3) continue;
    const Vector3d expected(0.097 * static_cast<double>(i), -0.031 * static_cast<double>(i), 4.5);
    EXPECT_LT((point(got, k) - expected).norm(), 1e-5) << i;
    EXPECT_EQ(got.cloud.intensity[k], static_cast<float>(i % 256)) << i;
    ++k;
  }
}

TEST(E57, RangesAndAnglesBecomePoints) {
  E57Maker maker;
  const auto half = static_cast<float>(M_PI / 2.0);
  const std::uint64_t place =
      maker.add_section({packet({floats({10, 4}), floats({0, half}), floats({0, half / 3})})});
  std::string prototype = kFloats;
  for (const auto& [from, to] :
       {std::pair{"cartesianX", "sphericalRange"}, std::pair{"cartesianY", "sphericalAzimuth"},
        std::pair{"cartesianZ", "sphericalElevation"}})
    prototype.replace(prototype.find(from), std::strlen(from), to);
  const ReadCloud got = read_e57(maker.file(scan_xml(place, 2, prototype)));
  ASSERT_EQ(got.cloud.points.size(), 2U);
  EXPECT_LT((point(got, 0) - Vector3d(10, 0, 0)).norm(), 1e-5);
  EXPECT_LT((point(got, 1) - Vector3d(0, 4 * std::cos(M_PI / 6), 2)).norm(), 1e-5);
}

TEST(E57, ScansFollowEachOtherAndOneThatIsDamagedCostsNoOther) {
  E57Maker maker;
  std::vector<float> many(2000, 3.0F);
  const std::uint64_t first =
      maker.add_section({packet({floats(many), floats(many), floats(many)})});
  const std::uint64_t second = maker.add_section({packet({floats({1}), floats({2}), floats({3})})});
  const std::string scans = scan_xml(first, 2000, kFloats) + scan_xml(second, 1, kFloats);
  Bytes bytes = maker.file(scans);
  EXPECT_EQ(read_e57(bytes).cloud.points.size(), 2001U);
  bytes[5000] ^= 1U;  // within the first scan
  const ReadCloud got = read_e57(bytes);
  ASSERT_EQ(got.cloud.points.size(), 1U);
  EXPECT_LT((point(got, 0) - Vector3d(1, 2, 3)).norm(), 1e-6);
  EXPECT_EQ(got.damage, 1U);
}

TEST(E57, WhatCannotBeReadIsNamed) {
  E57Maker maker;
  const std::uint64_t place = maker.add_section({packet({floats({1}), floats({2}), floats({3})})});
  const Bytes good = maker.file(scan_xml(place, 1, kFloats));
  Bytes cut(good.begin(), good.begin() + 100);
  EXPECT_NE(refusal(cut).find("within its header"), std::string::npos) << refusal(cut);
  Bytes damaged = good;
  damaged[60] ^= 4U;
  EXPECT_NE(refusal(damaged).find("checksum"), std::string::npos) << refusal(damaged);
  EXPECT_NE(refusal(maker.file("")).find("no scan"), std::string::npos);
  EXPECT_NE(
      refusal(maker.file(scan_xml(place, 1, "<rowIndex type=\"Integer\"/>"))).find("cartesianX"),
      std::string::npos);
  std::string swapped = kScaled;
  swapped.replace(swapped.find("-50000"), 6, "90000");
  EXPECT_NE(refusal(maker.file(scan_xml(place, 1, swapped))).find("cartesianX"), std::string::npos);
  EXPECT_NE(refusal(maker.file(scan_xml(1U << 30U, 1, kFloats))).find("not one"),
            std::string::npos);
  EXPECT_NE(refusal(maker.file("<vectorChild>")).find("XML"), std::string::npos);
}

TEST(E57, ACountThatNoFileHoldsTakesNoTime) {
  E57Maker maker;
  const std::uint64_t place = maker.add_section({});
  const std::string same =
      "<cartesianX type=\"Integer\" minimum=\"1\" maximum=\"1\"/>"
      "<cartesianY type=\"Integer\" minimum=\"2\" maximum=\"2\"/>"
      "<cartesianZ type=\"Integer\" minimum=\"3\" maximum=\"3\"/>";
  const ReadCloud got = read_e57(maker.file(scan_xml(place, std::size_t{1} << 60U, same)));
  EXPECT_EQ(got.cloud.points.size(), 1'000'000U);
  EXPECT_EQ(got.damage, 1U);
}

}  // namespace
}  // namespace understory
