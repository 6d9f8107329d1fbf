#include "understory/output/run_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <string_view>

#include "understory/util/files/csv.h"

namespace understory {
namespace {

// What a reader gets of a cell that was written with `csv_cell` or by a format.
double read_back(std::string_view text) {
  double value = std::numeric_limits<double>::quiet_NaN();
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

std::string seven_numbers(const Pose& pose) {
  Eigen::Quaterniond q = pose.rotation();
  if (q.w() < 0.0) q.coeffs() *= -1.0;
  const Eigen::Vector3d& t = pose.translation();
  return fmt::format("{:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}", t.x(), t.y(), t.z(), q.x(),
                     q.y(), q.z(), q.w());
}

template <typename Matrix>
void append_upper_triangle(std::string& line, const Matrix& matrix, const char* separator) {
  for (int i = 0; i < matrix.rows(); ++i) {
    for (int j = i; j < matrix.cols(); ++j)
      fmt::format_to(std::back_inserter(line), "{}{:.9e}", separator, matrix(i, j));
  }
}

}  // namespace

TumWriter::TumWriter(const std::filesystem::path& path) : file_(path) {}

StampedPose TumWriter::add(const StampedPose& pose) {
  const std::string numbers = seven_numbers(pose.world_from_body);
  file_.write(format_seconds(pose.stamp) + " " + numbers + "\n");
  std::array<double, 7> v{};
  std::string_view rest = numbers;
  for (double& value : v) {
    const std::size_t end = std::min(rest.find(' '), rest.size());
    value = read_back(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return {pose.stamp, Pose(Eigen::Quaterniond(v[6], v[3], v[4], v[5]), {v[0], v[1], v[2]})};
}

StatesWriter::StatesWriter(const std::filesystem::path& path) : file_(path) {
  std::string header = "timestamp,vx,vy,vz,gx,gy,gz,ax,ay,az";
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j)
      header += fmt::format(",c{}{}", i, j);
  }
  file_.write(header + "\n");
}

void StatesWriter::add(const StateRow& row) {
  std::string line = format_seconds(row.stamp);
  for (const Eigen::Vector3d* v : {&row.velocity_in_world, &row.gyro_bias, &row.accel_bias}) {
    for (int i = 0; i < 3; ++i)
      fmt::format_to(std::back_inserter(line), ",{:.9f}", (*v)[i]);
  }
  append_upper_triangle(line, row.pose_covariance, ",");
  file_.write(line + "\n");
}

GnssWriter::GnssWriter(const std::filesystem::path& path) : file_(path) {
  file_.write(
      "timestamp,x,y,z,latitude_deg,longitude_deg,height_m,c00,c01,c02,c11,c12,c22,hdop,vdop,"
      "satellites,quality,residual_x,residual_y,residual_z,used,reason,heading_deg,heading_sd_"
      "deg\n");
}

void GnssWriter::add(const GnssRow& row) {
  std::string line = format_seconds(row.fix.stamp);
  const auto put = [&](double value, int decimals) { line += "," + csv_cell(value, decimals); };
  for (int i = 0; i < 3; ++i)
    put(row.position_in_world[i], 4);
  put(row.fix.latitude_deg, 9);
  put(row.fix.longitude_deg, 9);
  put(row.fix.height_m, 4);
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j)
      put(row.fix.covariance(i, j), 6);
  }
  put(row.fix.hdop, 2);
  put(row.fix.vdop, 2);
  line += row.fix.satellites < 0 ? "," : fmt::format(",{}", row.fix.satellites);
  line += fmt::format(",{}", row.fix.quality);
  for (int i = 0; i < 3; ++i)
    put(row.residual[i], 4);
  line += fmt::format(",{},{}", row.used ? 1 : 0, csv_text(row.reason));
  put(row.fix.heading_deg, 4);
  put(row.fix.heading_sd_deg, 4);
  file_.write(line + "\n");
}

Matrix6d g2o_information(const Matrix6d& information) {
  // error = (translation, quaternion vector) = (v, omega / 2), so omega = 2 q and v = t.
  Matrix6d ours_from_g2o = Matrix6d::Zero();
  ours_from_g2o.topRightCorner<3, 3>() = 2.0 * Eigen::Matrix3d::Identity();
  ours_from_g2o.bottomLeftCorner<3, 3>() = Eigen::Matrix3d::Identity();
  return ours_from_g2o.transpose() * information * ours_from_g2o;
}

void write_g2o(const std::filesystem::path& path, const std::vector<GraphVertex>& vertices,
               const std::vector<GraphEdge>& edges) {
  AtomicTextFile file(path);
  for (const GraphVertex& vertex : vertices) {
    file.write(
        fmt::format("VERTEX_SE3:QUAT {} {}\n", vertex.id, seven_numbers(vertex.world_from_body)));
    if (vertex.fixed) file.write(fmt::format("FIX {}\n", vertex.id));
  }
  for (const GraphEdge& edge : edges) {
    std::string line =
        fmt::format("EDGE_SE3:QUAT {} {} {}", edge.from, edge.to, seven_numbers(edge.from_from_to));
    append_upper_triangle(line, g2o_information(edge.information), " ");
    file.write(line + "\n");
  }
  file.commit();
}

void write_trees_csv(const std::filesystem::path& path, const std::vector<Tree>& trees) {
  AtomicTextFile file(path);
  file.write(tree_csv_header() + "\n");
  for (const Tree& tree : trees)
    file.write(tree_csv_row(tree) + "\n");
  file.commit();
}

void write_stem_curves(const std::filesystem::path& path, const std::vector<Tree>& trees,
                       const std::vector<StemCurve>& curves, const Eigen::Vector2d& origin) {
  AtomicTextFile file(path);
  file.write("tree_id,height_m,x,y,diameter_m,diameter_sd_m,measured\n");
  for (std::size_t i = 0; i < curves.size(); ++i) {
    for (const CurveSection& section : curves[i].sections)
      file.write(fmt::format("{},{:.2f},{},{},{:.4f},{:.4f},{}\n", trees[i].id, section.height_m,
                             csv_cell(origin.x() + section.centre.x(), 3),
                             csv_cell(origin.y() + section.centre.y(), 3), section.diameter_m,
                             section.diameter_sd_m, section.measured ? 1 : 0));
  }
  file.commit();
}

void write_dead_wood(const std::filesystem::path& path, const std::vector<DeadWood>& pieces) {
  AtomicTextFile file(path);
  file.write(
      "id,kind,x,y,z,x_to,y_to,z_to,diameter_m,diameter_to_m,diameter_sd_m,length_m,volume_m3,"
      "observations\n");
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const DeadWood& piece = pieces[i];
    file.write(fmt::format(
        "{},{},{},{},{},{},{},{},{:.3f},{:.3f},{:.3f},{:.2f},{:.4f},{}\n", i + 1,
        dead_wood_name(piece.kind), csv_cell(piece.from.x(), 3), csv_cell(piece.from.y(), 3),
        csv_cell(piece.from.z(), 3), csv_cell(piece.to.x(), 3), csv_cell(piece.to.y(), 3),
        csv_cell(piece.to.z(), 3), piece.diameter_m, piece.diameter_to_m, piece.diameter_sd_m,
        piece.length_m(), piece.volume_m3(), piece.observations));
  }
  file.commit();
}

void write_tree_falls(const std::filesystem::path& path, const std::vector<TreeFall>& falls) {
  AtomicTextFile file(path);
  file.write("id,x,y,seen_until,gone_since,missed\n");
  for (const TreeFall& fall : falls)
    file.write(fmt::format("{},{},{},{},{},{}\n", fall.tree_id, csv_cell(fall.x, 3),
                           csv_cell(fall.y, 3), format_seconds(fall.seen_until),
                           format_seconds(fall.gone_since), fall.missed));
  file.commit();
}

StemsWriter::StemsWriter(const std::filesystem::path& path) : file_(path) {
  file_.write(
      "frame,timestamp,x,y,z,axis_x,axis_y,axis_z,length_m,dbh_m,score,radius_m,radius_sd_m,xx,xy,"
      "yy,zz\n");
}

Stem StemsWriter::add(int frame, TimeNs stamp, const Stem& stem) {
  std::string line = fmt::format("{},{}", frame, format_seconds(stamp));
  const auto add_cell = [&](const std::string& text) {
    line += "," + text;
    return static_cast<float>(read_back(text));
  };
  const auto fixed = [&](float value, int decimals) {
    return add_cell(csv_cell(static_cast<double>(value), decimals));
  };
  // Two figures tell a spread.
  const auto spread = [&](float value) {
    return add_cell(std::isnan(value) ? std::string() : fmt::format("{:.2g}", value));
  };
  Stem read;
  // A sight errs by centimetres and by a degree; further digits are noise that does not compress.
  for (int i = 0; i < 3; ++i)
    read.point[i] = fixed(stem.point[i], 3);
  Eigen::Vector3d axis;
  for (int i = 0; i < 3; ++i) {
    const std::string text = csv_cell(static_cast<double>(stem.axis[i]), 4);
    axis[i] = read_back(text);
    line += "," + text;
  }
  // Readers bring axes to unit length.
  read.axis = axis.array().isNaN().all()
                  ? Eigen::Vector3f(Eigen::Vector3f::Constant(Stem::kUnknown))
                  : Eigen::Vector3f((axis / axis.norm()).cast<float>());
  read.length_m = fixed(stem.length_m, 2);
  read.dbh_m = fixed(stem.dbh_m, 3);
  read.score = fixed(stem.score, 3);
  read.radius_m = fixed(stem.radius_m, 3);
  read.radius_sd_m = fixed(stem.radius_sd_m, 3);
  read.xx = spread(stem.xx);
  read.xy = spread(stem.xy);
  read.yy = spread(stem.yy);
  read.zz = spread(stem.zz);
  file_.write(line + "\n");
  return read;
}

}  // namespace understory
